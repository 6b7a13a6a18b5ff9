//! The checked, immutable model: moving bodies, their trees, wheels and frames.
//!
//! A model is built once from a [`ModelDescription`], shared between threads and never changed.
//! Locked (welded) and fixed joints are eliminated: the inertia of the solid is merged into the
//! body that carries it, and the coordinate disappears from every matrix.

mod body;
mod build;
mod close;
pub(in crate::multibody) mod closed_loop;
mod edit;
mod levers;
mod links;
mod machines;
mod parts;
mod properties;
mod speed_gains;
mod spinners;
mod tree;

use std::sync::Arc;

pub use body::Body;
pub use closed_loop::{Loop, LoopGap};
pub use edit::Changes;
pub use machines::MachineSpan;
pub use parts::{Collider, ColliderForm, CollisionBox, CollisionSphere, Frame, Wheel};
pub use properties::{JointProperties, Passive};
pub use tree::Tree;

use super::description::check::check;
use super::description::{Hold, ModelDescription};
use super::error::ModelError;
use super::inertias::Inertias;
use super::joint::Joint;
pub use super::mechanism::BASE;
use super::mechanism::{Mechanism, PathVelocity};
use crate::law::materials::OwnFriction;

/// Kinematic trees. Velocities are in the order of the bodies; [`super::joint`] lists those of each
/// joint.
#[derive(Clone, Debug)]
pub struct Model {
    description: ModelDescription,
    bodies: Vec<Body>,
    trees: Vec<Tree>,
    mechanism: Arc<Mechanism>,
    inertias: Inertias<f64>,
    frames: Vec<Frame>,
    wheels: Vec<Wheel>,
    boxes: Vec<CollisionBox>,
    spheres: Vec<CollisionSphere>,
    colliders: Vec<Collider>,
    body_of_velocity: Vec<usize>,
    /// Number of leading path entries that bodies `a` and `b` share: `common[a * n_bodies + b]`.
    common: Vec<usize>,
    joints: Vec<JointProperties>,
    joint_velocities: Vec<usize>,
    /// Velocities of joints with rotors, and the rotor inertias.
    armatures: Vec<(usize, f64)>,
    /// Indices of the joints with stops.
    limited: Vec<usize>,
    /// Indices of the joints with dry friction.
    rubbing: Vec<usize>,
    loops: Vec<Loop>,
    own_frictions: Arc<[OwnFriction]>,
    machines: Vec<MachineSpan>,
    has_slides: bool,
    mass: f64,
    fingerprint: u64,
}

impl Model {
    /// Checks a description and builds the trees. Joints that it locks have no coordinate.
    ///
    /// # Errors
    /// The first invalid entry, named by its field.
    pub fn from_description(mut description: ModelDescription) -> Result<Self, ModelError> {
        description.lay_tracks()?;
        check(&description)?;
        description.state_deflections();
        Self::build(description)
    }

    /// The rover of the report, with 21 degrees of freedom, on rigid wheels.
    ///
    /// # Panics
    /// If the built-in file is invalid, which the tests exclude.
    #[must_use]
    pub fn rover() -> Self {
        Self::built_in(ModelDescription::rover())
    }

    /// The rover of the gallery: that of the report on wheels that yield.
    ///
    /// # Panics
    /// If the built-in file is invalid, which the tests exclude.
    #[must_use]
    pub fn gallery_rover() -> Self {
        Self::built_in(ModelDescription::gallery_rover())
    }

    fn built_in(description: ModelDescription) -> Self {
        match Self::from_description(description) {
            Ok(model) => model,
            Err(e) => panic!("invariant: the built-in rover is valid: {e}"),
        }
    }

    /// The description from which it was built.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Moving bodies, parents before children.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Kinematic trees.
    #[must_use]
    pub fn trees(&self) -> &[Tree] {
        &self.trees
    }

    /// The bodies and joints, as the sources of the dynamics read them.
    #[inline]
    #[must_use]
    pub fn mechanism(&self) -> &Arc<Mechanism> {
        &self.mechanism
    }

    /// Inertias of the bodies of [`Self::mechanism`].
    #[inline]
    #[must_use]
    pub fn inertias(&self) -> &Inertias<f64> {
        &self.inertias
    }

    /// Indices of the joints with dry friction, ascending.
    #[inline]
    #[must_use]
    pub fn rubbing_joints(&self) -> &[usize] {
        &self.rubbing
    }

    /// Closed loops of the model, in description order.
    #[inline]
    #[must_use]
    pub fn loops(&self) -> &[Loop] {
        &self.loops
    }

    /// Whether one of its loops ties it to the world.
    #[must_use]
    pub fn holds_the_world(&self) -> bool {
        self.loops.iter().any(Loop::holds_the_world)
    }

    /// Machines of the model, in description order; one if the description names none.
    #[must_use]
    pub fn machines(&self) -> &[MachineSpan] {
        &self.machines
    }

    /// Frames of all solids, in description order.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Wheels, in description order.
    #[must_use]
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels
    }

    /// Boxes that collide, in the order of the solids and their shapes.
    #[must_use]
    pub fn boxes(&self) -> &[CollisionBox] {
        &self.boxes
    }

    /// Balls that collide, in the order of the solids and their shapes.
    #[must_use]
    pub fn spheres(&self) -> &[CollisionSphere] {
        &self.spheres
    }

    /// Cylinders, capsules, ellipsoids and hulls that collide, in the order of the solids and their
    /// shapes.
    #[must_use]
    pub fn colliders(&self) -> &[Collider] {
        &self.colliders
    }

    /// Whether parts of two bodies can touch. Within one tree this requires self-contact, and
    /// bodies connected by a joint never touch.
    #[must_use]
    pub fn can_touch(&self, a: usize, b: usize) -> bool {
        let (first, second) = (&self.bodies[a], &self.bodies[b]);
        let is_joined = first.parent == Some(b) || second.parent == Some(a);
        let collides = self.trees[first.tree].self_contact && a != b && !is_joined;
        first.tree != second.tree || collides
    }

    /// Number of velocities.
    #[inline]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.mechanism.nv()
    }

    /// Number of joints with one coordinate of their own: revolute and prismatic joints that are
    /// neither locked nor coupled.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Number of motions; see [`Self::movers`].
    #[must_use]
    pub fn n_motions(&self) -> usize {
        self.mechanism.n_motions()
    }

    /// Number of poses in a configuration: the first body's and those of all other free bodies.
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.mechanism.n_poses
    }

    /// Number of spherical joints.
    #[must_use]
    pub fn n_rotations(&self) -> usize {
        self.mechanism.n_rotations
    }

    /// Whether all trees are on free bases.
    #[must_use]
    pub fn is_free(&self) -> bool {
        self.trees.iter().all(|tree| tree.is_free)
    }

    /// A number that two models share only if they have the same description and the same locked
    /// joints.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Total mass, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Whether any joint is prismatic: its displacement adds to [`Tree::reach`].
    #[inline]
    #[must_use]
    pub fn has_slides(&self) -> bool {
        self.has_slides
    }

    /// Whether any wheel has rollers.
    #[inline]
    #[must_use]
    pub fn has_rollers(&self) -> bool {
        self.wheels.iter().any(|wheel| wheel.rollers.is_some())
    }

    /// Materials with a friction of their own.
    #[must_use]
    pub fn own_frictions(&self) -> &Arc<[OwnFriction]> {
        &self.own_frictions
    }

    /// Whether any wheel yields where it touches.
    #[inline]
    #[must_use]
    pub fn has_compliance(&self) -> bool {
        self.wheels.iter().any(|wheel| wheel.tread.is_some())
    }

    /// Free and spherical joints, whose coordinates are quaternions, with their first velocities.
    #[inline]
    #[must_use]
    pub fn rotating_joints(&self) -> &[(Joint, usize)] {
        &self.mechanism.rotating
    }

    /// Velocities of joints with rotors, and the rotor inertias (kg m² or kg).
    #[inline]
    #[must_use]
    pub fn armatures(&self) -> &[(usize, f64)] {
        &self.armatures
    }

    /// Indices of the joints with stops.
    #[inline]
    #[must_use]
    pub fn limited_joints(&self) -> &[usize] {
        &self.limited
    }

    /// Velocity indices that move body `b`, root first.
    #[inline]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        self.mechanism.path(b)
    }

    /// Number of leading path entries that two bodies share.
    #[inline]
    #[must_use]
    pub fn common_path(&self, a: usize, b: usize) -> usize {
        self.common[a * self.bodies.len() + b]
    }

    /// Number of velocities of a free base at the start of body `b`'s path: 6, or 0 in a tree
    /// without a free base.
    #[inline]
    #[must_use]
    pub fn lead(&self, b: usize) -> usize {
        self.trees[self.bodies[b].tree].lead()
    }

    /// The body whose joint has velocity `k`.
    #[inline]
    #[must_use]
    pub fn body_of_velocity(&self, k: usize) -> usize {
        self.body_of_velocity[k]
    }

    /// The velocities that move body `b` beyond [`Self::lead`], in path order, and their motions
    /// ([`Kinematics::motions`](super::Kinematics::motions)).
    #[inline]
    #[must_use]
    pub fn movers(&self, b: usize) -> &[PathVelocity] {
        self.mechanism.movers(b)
    }

    /// Joints with one coordinate of their own, in the order of commands and of
    /// [`Configuration::joints`](super::Configuration::joints).
    #[inline]
    #[must_use]
    pub fn joints(&self) -> &[JointProperties] {
        &self.joints
    }

    /// Energy stored in all springs at joint coordinates (n_joints), J.
    #[must_use]
    pub fn spring_energy(&self, coordinates: &[f64]) -> f64 {
        let joints = self.joints.iter().zip(coordinates);
        joints.map(|(joint, q)| joint.passive.potential(*q)).sum()
    }

    /// Index of a joint in [`Self::joints`], by name.
    #[must_use]
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        let mut joints = self.joints.iter();
        joints.position(|joint| self.bodies[joint.body].name == name)
    }

    /// Velocity index of every joint (n_joints).
    #[inline]
    #[must_use]
    pub fn joint_velocities(&self) -> &[usize] {
        &self.joint_velocities
    }

    /// Velocity index of a joint.
    #[inline]
    #[must_use]
    pub fn joint_velocity(&self, joint: usize) -> usize {
        self.joint_velocities[joint]
    }

    /// PD gains of a joint.
    #[must_use]
    pub fn hold(&self, joint: usize) -> Hold {
        self.joints[joint].hold
    }
}

/// FNV-1a hash of the data that distinguishes models; the same on every machine and in every
/// version.
pub(crate) fn fingerprint(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
