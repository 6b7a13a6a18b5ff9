//! The checked, immutable model: moving bodies, their trees, wheels and frames.
//!
//! Built once from a [`ModelDescription`], shared between threads, never changed. A locked (welded)
//! or fixed joint leaves no trace: the inertia of its solid is merged into the body that carries it
//! and its coordinate is gone from every matrix.

mod build;
mod edit;
mod parts;
mod properties;
mod spinners;
mod tree;

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

pub use parts::{CollisionBox, CollisionSphere, Frame, Wheel};
pub use properties::{JointProperties, Passive};
use tree::Paths;
pub use tree::Tree;

use super::description::check::check;
use super::description::{Hold, ModelDescription};
use super::error::ModelError;
use super::joint::{Joint, free};
use super::state::Configuration;

/// Most solids of a model, and most wheels and tags: beyond it a step costs seconds and matrices
/// gigabytes.
pub const MAX_SOLIDS: usize = 1000;

/// Most shapes that the solids of a model list, all together.
pub const MAX_SHAPES: usize = 4000;

/// Velocities of a free base, with which every path of its tree begins.
pub const BASE: usize = free::NV;

/// A moving body: one or several solids fixed to each other, under one joint.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name of its first solid, and of its joint.
    pub name: String,
    /// Index of the body that carries it; none for a root.
    pub parent: Option<usize>,
    /// Index of its tree.
    pub tree: usize,
    /// Joint's origin in the parent's frame, m; a root's in the world.
    pub position: Vector3<f64>,
    /// Fixed rotation from the joint's frame to the parent's, where there is one.
    pub rotation: Option<Matrix3<f64>>,
    /// What moves it relative to its parent.
    pub joint: Joint,
    /// Its joint's first velocity: its own or, of a coupled joint, the one that it follows.
    pub velocity: usize,
    /// Its joint's first motion, and their number.
    pub motion: usize,
    /// See [`Self::motions`].
    pub n_motions: usize,
    /// Whether its joint follows another.
    pub is_coupled: bool,
    /// kg.
    pub mass: f64,
    /// Mass centre in the body's frame, m.
    pub centre_of_mass: Vector3<f64>,
    /// Principal moments about the mass centre, kg m².
    pub principal_inertia: Vector3<f64>,
    /// Principal axes as columns, in the body's frame; none where they are the frame's.
    pub principal_axes: Option<Matrix3<f64>>,
    /// Whether turning about its own joint changes nothing but its looks: an axisymmetric body
    /// about its own axis, with nothing on it but wheels of the same axle. A step need not turn it.
    pub is_spinner: bool,
}

impl Body {
    /// Whether its mass centre is its frame's origin.
    #[inline]
    #[must_use]
    pub fn is_centred(&self) -> bool {
        self.centre_of_mass == Vector3::zeros()
    }

    /// Its joint's motions in [`Kinematics::motions`](super::Kinematics::motions).
    #[inline]
    #[must_use]
    pub fn motions(&self) -> Range<usize> {
        self.motion..self.motion + self.n_motions
    }
}

/// Trees of bodies. Velocities in the order of the bodies: see [`super::joint`] for those of each
/// joint.
#[derive(Clone, Debug)]
pub struct Model {
    description: ModelDescription,
    bodies: Vec<Body>,
    trees: Vec<Tree>,
    frames: Vec<Frame>,
    wheels: Vec<Wheel>,
    boxes: Vec<CollisionBox>,
    spheres: Vec<CollisionSphere>,
    paths: Paths,
    joints: Vec<JointProperties>,
    joint_velocities: Vec<usize>,
    /// Bodies whose joints follow others.
    coupled: Vec<usize>,
    /// Velocities of joints with rotors, and the rotors' inertias.
    armatures: Vec<(usize, f64)>,
    /// Joints with stops.
    limited: Vec<usize>,
    n_poses: usize,
    n_rotations: usize,
    has_slides: bool,
    only_turns: bool,
    /// Free and spherical joints, with their first velocities.
    rotating: Vec<(Joint, usize)>,
    mass: f64,
    /// Velocity indices of the joints of spinners, and of all other joints that turn.
    spinning: Vec<usize>,
    turning: Vec<usize>,
    fingerprint: u64,
}

impl Model {
    /// Checks a description and builds the trees; joints that it locks have no coordinate.
    ///
    /// # Errors
    /// The first thing found wrong, naming its field.
    pub fn from_description(description: ModelDescription) -> Result<Self, ModelError> {
        check(&description)?;
        Self::build(description)
    }

    /// The built-in rover of the report, 21 degrees of freedom.
    ///
    /// # Panics
    /// If the built-in file is invalid, which the tests exclude.
    #[must_use]
    pub fn rover() -> Self {
        match Self::from_description(ModelDescription::rover()) {
            Ok(model) => model,
            Err(e) => panic!("invariant: the built-in rover is valid: {e}"),
        }
    }

    /// The description that it was built from.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Moving bodies, parents before children.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Trees of bodies.
    #[must_use]
    pub fn trees(&self) -> &[Tree] {
        &self.trees
    }

    /// Frames of all solids, in the order of the description.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Wheels, in the order of the description.
    #[must_use]
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels
    }

    /// Boxes that touch, in the order of the solids and their shapes.
    #[must_use]
    pub fn boxes(&self) -> &[CollisionBox] {
        &self.boxes
    }

    /// Balls that touch, in the order of the solids and their shapes.
    #[must_use]
    pub fn spheres(&self) -> &[CollisionSphere] {
        &self.spheres
    }

    /// Whether parts of two bodies can touch: in one tree only where it has self-contact, and not
    /// across a joint.
    #[must_use]
    pub fn can_touch(&self, a: usize, b: usize) -> bool {
        let (first, second) = (&self.bodies[a], &self.bodies[b]);
        let is_joined = first.parent == Some(b) || second.parent == Some(a);
        first.tree != second.tree || (self.description.self_contact && a != b && !is_joined)
    }

    /// Number of velocities, of all joints together.
    #[inline]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.paths.body_of_velocity.len()
    }

    /// Number of joints with one coordinate of their own: revolute and prismatic ones that are
    /// neither locked nor coupled.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Number of motions: see [`Self::motions`].
    #[must_use]
    pub fn n_motions(&self) -> usize {
        self.paths.n_motions
    }

    /// Number of poses of a configuration: the first body's, and those of all other free bodies.
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.n_poses
    }

    /// Number of spherical joints.
    #[must_use]
    pub fn n_rotations(&self) -> usize {
        self.n_rotations
    }

    /// Whether it is one tree on a free base, as a rover is.
    #[inline]
    #[must_use]
    pub fn is_free_tree(&self) -> bool {
        self.trees.len() == 1 && self.trees[0].is_free
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

    /// Whether a joint is prismatic, so that its displacement adds to [`Tree::reach`].
    #[inline]
    #[must_use]
    pub fn has_slides(&self) -> bool {
        self.has_slides
    }

    /// Whether every root is free and every other joint revolute and on its own, as a rover's are:
    /// hot loops then run without a branch on the kind of joint.
    #[inline]
    #[must_use]
    pub fn only_turns(&self) -> bool {
        self.only_turns
    }

    /// Free and spherical joints, which have quaternions, with their first velocities.
    #[inline]
    #[must_use]
    pub fn rotating_joints(&self) -> &[(Joint, usize)] {
        &self.rotating
    }

    /// Velocity indices of the joints whose turning changes only looks: see [`Body::is_spinner`].
    #[must_use]
    pub fn spinning_joints(&self) -> &[usize] {
        &self.spinning
    }

    /// Velocity indices of all other joints that turn.
    #[must_use]
    pub fn turning_joints(&self) -> &[usize] {
        &self.turning
    }

    /// Bodies whose joints follow others.
    #[inline]
    #[must_use]
    pub fn coupled_bodies(&self) -> &[usize] {
        &self.coupled
    }

    /// Velocities of joints with rotors, and the rotors' inertias (kg m² or kg).
    #[inline]
    #[must_use]
    pub fn armatures(&self) -> &[(usize, f64)] {
        &self.armatures
    }

    /// Numbers of the joints with stops.
    #[inline]
    #[must_use]
    pub fn limited_joints(&self) -> &[usize] {
        &self.limited
    }

    /// Velocity indices that move body `b`, root first.
    #[inline]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        self.paths.path(b)
    }

    /// Velocity indices from the root to velocity `k` itself.
    #[inline]
    #[must_use]
    pub(crate) fn velocity_path(&self, k: usize) -> &[usize] {
        self.paths.velocity_path(k)
    }

    /// Longest path: the stride of everything that is stored along paths.
    #[inline]
    #[must_use]
    pub fn path_stride(&self) -> usize {
        self.paths.stride
    }

    /// How many leading path entries two bodies share.
    #[inline]
    #[must_use]
    pub fn common_path(&self, a: usize, b: usize) -> usize {
        self.paths.common(a, b)
    }

    /// How many velocities of a free base begin the path of body `b`: 6, or 0 in a tree without
    /// one.
    #[inline]
    #[must_use]
    pub fn lead(&self, b: usize) -> usize {
        self.paths.lead(b)
    }

    /// Body whose joint has velocity `k`.
    #[inline]
    #[must_use]
    pub fn body_of_velocity(&self, k: usize) -> usize {
        self.paths.body_of_velocity[k]
    }

    /// The path of body `b` in two parts: the velocities of a free base, which are consecutive, and
    /// those of the joints.
    #[inline]
    #[must_use]
    pub fn split_path(&self, b: usize) -> (Range<usize>, &[usize]) {
        self.paths.split(b)
    }

    /// The motions ([`Kinematics::motions`](super::Kinematics::motions)) that the velocities of
    /// body `b`'s path beyond its [`Self::lead`] give it, in the order of the path.
    #[inline]
    #[must_use]
    pub fn motions(&self, b: usize) -> &[usize] {
        self.paths.motions(b)
    }

    /// Joints with one coordinate of their own, in the order of commands and of
    /// [`Configuration::joints`](super::Configuration::joints).
    #[inline]
    #[must_use]
    pub fn joints(&self) -> &[JointProperties] {
        &self.joints
    }

    /// Energy of all springs in a configuration, J.
    #[must_use]
    pub fn spring_energy(&self, q: &Configuration) -> f64 {
        let joints = self.joints.iter().zip(&q.joints);
        joints.map(|(joint, q)| joint.passive.potential(*q)).sum()
    }

    /// Number of a joint by name: its index in [`Self::joints`].
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

    /// Gains with which a joint is held.
    #[must_use]
    pub fn hold(&self, joint: usize) -> Hold {
        self.joints[joint].hold
    }
}

/// FNV-1a over what tells models apart; the same on every machine and in every version.
pub(crate) fn fingerprint(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
