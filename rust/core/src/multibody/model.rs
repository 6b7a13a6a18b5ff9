//! The checked, immutable model: moving bodies, their tree, wheels and frames.
//!
//! Built once from a [`ModelDescription`], shared between threads, never changed. A locked (welded)
//! joint leaves no trace: the inertia of its solid is merged into the body that carries it and its
//! coordinate is gone from every matrix.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::description::{Hold, ModelDescription, Shape, SolidDescription};
use super::error::ModelError;
use super::joint::JointAxis;
use super::motor::Motor;
use crate::spatial::SymmetricMatrix3;

/// Most solids of a model, and most wheels and tags: beyond it a step costs seconds and matrices gigabytes.
pub const MAX_SOLIDS: usize = 1000;

/// Velocities of a free base, with which every path of its tree begins.
pub const BASE: usize = 6;

/// Largest length of a description either way, m.
const MAX_LENGTH: f64 = 1e6;

/// A moving body: one or several solids fixed to each other, under one revolute joint (the base: free).
#[derive(Clone, Debug)]
pub struct Body {
    /// Name of its first solid, and of its joint.
    pub name: String,
    /// Index of the body that carries it (0 for the base itself).
    pub parent: usize,
    /// Joint's origin in the parent's frame, m.
    pub position: Vector3<f64>,
    /// Fixed rotation from the joint's frame to the parent's, where there is one.
    pub rotation: Option<Matrix3<f64>>,
    /// Axis of the joint (meaningless for the base).
    pub axis: JointAxis,
    /// kg.
    pub mass: f64,
    /// Mass centre in the body's frame, m.
    pub centre_of_mass: Vector3<f64>,
    /// Principal moments about the mass centre, kg m².
    pub principal_inertia: Vector3<f64>,
    /// Principal axes as columns, in the body's frame; none where they are the frame's.
    pub principal_axes: Option<Matrix3<f64>>,
    /// Gains with which the joint is held.
    pub hold: Hold,
    /// Whether turning about its own joint changes nothing but its looks: an axisymmetric body about its own axis, with
    /// nothing on it but wheels of the same axle. A step need not turn it.
    pub is_spinner: bool,
}

impl Body {
    /// Whether its mass centre is its frame's origin.
    #[inline]
    #[must_use]
    pub fn is_centred(&self) -> bool {
        self.centre_of_mass == Vector3::zeros()
    }
}

/// The frame of a solid, fixed to a moving body.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Name of the solid.
    pub name: String,
    /// Body that carries it.
    pub body: usize,
    /// Origin in the body's frame, m.
    pub position: Vector3<f64>,
    /// Rotation from the solid's frame to the body's.
    pub rotation: Matrix3<f64>,
}

/// A wheel: disc of radius `radius` and no width, fixed to a body.
#[derive(Clone, Debug)]
pub struct Wheel {
    /// Short name, such as `FL`.
    pub name: String,
    /// Body that it is fixed to.
    pub body: usize,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Unit axle in the body's frame.
    pub axle: Vector3<f64>,
    /// A unit vector in the wheel's plane, body's frame: rolling direction where no other is defined.
    pub spoke: Vector3<f64>,
    /// Contact radius, m.
    pub radius: f64,
    /// Largest driving torque, N m.
    pub torque_limit: f64,
    /// 1 or −1: joint torque of a positive (forward) command.
    pub drive_sign: f64,
    /// Torque–speed line of its motor, where it has one.
    pub motor: Option<Motor>,
    /// Its own joint, by its number ([`Model::joint_index`]); none where it is locked.
    pub joint: Option<usize>,
    /// Its steering joint, by its number; none where there is none or it is locked.
    pub steering: Option<usize>,
    /// Largest steering set-point either way, rad.
    pub steering_limit: f64,
}

/// A box that touches the ground.
#[derive(Clone, Debug)]
pub struct CollisionBox {
    /// Body that carries it.
    pub body: usize,
    /// Name of its solid.
    pub name: String,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Rotation from the box's frame to the body's.
    pub rotation: Matrix3<f64>,
    /// Half edge lengths, m.
    pub half_size: Vector3<f64>,
}

/// A ball that touches the ground.
#[derive(Clone, Debug)]
pub struct CollisionSphere {
    /// Body that carries it.
    pub body: usize,
    /// Name of its solid.
    pub name: String,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// m.
    pub radius: f64,
}

/// A tree of bodies under a free base. Velocity: 3 linear (trunk origin, world), 3 angular (world), joint rates.
#[derive(Clone, Debug)]
pub struct Model {
    description: ModelDescription,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    wheels: Vec<Wheel>,
    boxes: Vec<CollisionBox>,
    spheres: Vec<CollisionSphere>,
    /// Velocity indices from the base to body `b`: `paths[b * path_stride ..][.. path_lengths[b]]`.
    paths: Vec<usize>,
    path_lengths: Vec<usize>,
    path_stride: usize,
    /// Numbers of the joints from the base to a body, in the manner of `paths`.
    motions: Vec<usize>,
    joint_velocities: Vec<usize>,
    body_of_velocity: Vec<usize>,
    /// How many leading path entries bodies `a` and `b` share: `common[a * n_bodies + b]`.
    common: Vec<usize>,
    mass: f64,
    reach: f64,
    /// Velocity indices of the joints of spinners, and of all others.
    spinning: Vec<usize>,
    turning: Vec<usize>,
    fingerprint: u64,
}

/// Mass, first moment and inertia about the body frame's origin, while solids are merged.
#[derive(Clone, Default)]
struct Lump {
    mass: f64,
    moment: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Model {
    /// Checks a description and builds the tree; joints that it locks have no coordinate.
    ///
    /// # Errors
    /// The first thing found wrong, naming its field.
    pub fn from_description(description: ModelDescription) -> Result<Self, ModelError> {
        check(&description)?;
        Ok(Self::build(description))
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

    /// The same machine with joints locked at angles (rad): their solids are merged and the coordinates gone.
    ///
    /// # Errors
    /// `UnknownName` for a joint that is not there, `NotFinite` for an angle that is not finite.
    pub fn with_locked_joints(&self, joints: &[(String, f64)]) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        for (i, (name, angle)) in joints.iter().enumerate() {
            let mut solids = description.solids.iter_mut().skip(1);
            let Some(solid) = solids.find(|s| &s.name == name) else {
                return Err(ModelError::UnknownName {
                    field: format!("joints[{i}]"),
                    name: name.clone(),
                });
            };
            in_range(&format!("joints[{name}]"), *angle, 1e9, "at most 1e9 rad")?;
            solid.locked = Some(*angle);
        }
        Ok(Self::build(description))
    }

    /// The same machine with wheels of another radius (m): the shape, its inertia and the contact change together. An
    /// inertia that the description states is scaled by the square of the radius.
    ///
    /// # Errors
    /// `NotADisc` for a wheel whose solid has another shape; a radius out of its range.
    pub fn with_wheel_radius(&self, radius: f64) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        length("wheel_radius", radius)?;
        for wheel in &mut description.wheels {
            let mut solids = description.solids.iter_mut();
            let solid = solids.find(|s| s.name == wheel.solid);
            if let Some(solid) = solid {
                let Shape::Disc { radius: before } = &mut solid.shape else {
                    return Err(ModelError::NotADisc {
                        field: "wheel_radius",
                        solid: wheel.solid.clone(),
                    });
                };
                let scale = (radius / *before).powi(2);
                *before = radius;
                for entry in solid.inertia.iter_mut().flatten() {
                    *entry *= scale;
                }
            }
            wheel.radius = radius;
            wheel.contact_radius = None;
        }
        Self::from_description(description)
    }

    /// The same machine whose wheels touch the ground at another radius (m) than their discs': masses, inertias and looks stay.
    ///
    /// # Errors
    /// A radius out of its range.
    pub fn with_contact_radius(&self, radius: f64) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        length("contact_radius", radius)?;
        for wheel in &mut description.wheels {
            wheel.contact_radius = Some(radius);
        }
        Self::from_description(description)
    }

    /// The same machine with another torque–speed line, or none, on all wheels.
    ///
    /// # Errors
    /// `NotPositive` or `NotFinite` for a torque or a speed that is none.
    pub fn with_motors(&self, motor: Option<Motor>) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        for wheel in &mut description.wheels {
            wheel.motor = motor;
        }
        Self::from_description(description)
    }

    #[allow(clippy::too_many_lines)] // one pass over the solids; its parts share every local
    fn build(description: ModelDescription) -> Self {
        let mut bodies: Vec<Body> = Vec::new();
        let mut lumps: Vec<Lump> = Vec::new();
        let mut frames: Vec<Frame> = Vec::new();
        let mut boxes = Vec::new();
        let mut spheres = Vec::new();
        let index_of: HashMap<&str, usize> = (description.solids.iter().map(|s| s.name.as_str()))
            .zip(0..)
            .collect();
        for (i, solid) in description.solids.iter().enumerate() {
            let axis = solid
                .axis
                .and_then(|a| JointAxis::from_direction(&a.into()))
                .unwrap_or(JointAxis::X);
            let parent = solid
                .parent
                .as_deref()
                .and_then(|p| index_of.get(p).copied());
            let frame = if let (Some(p), true) = (parent, i > 0) {
                let carrier: Frame = frames[p].clone();
                let position = carrier.position
                    + carrier.rotation * Vector3::from(solid.position.unwrap_or_default());
                if let Some(angle) = solid.locked {
                    let (rotation, _) = axis.rotate(&carrier.rotation, angle);
                    Frame {
                        name: solid.name.clone(),
                        body: carrier.body,
                        position,
                        rotation,
                    }
                } else {
                    let fixed = carrier.rotation;
                    bodies.push(Body {
                        name: solid.name.clone(),
                        parent: carrier.body,
                        position,
                        rotation: (fixed != Matrix3::identity()).then_some(fixed),
                        axis,
                        mass: 0.0,
                        centre_of_mass: Vector3::zeros(),
                        principal_inertia: Vector3::zeros(),
                        principal_axes: None,
                        hold: solid.hold.unwrap_or(Hold {
                            stiffness: 0.0,
                            damping: 0.0,
                        }),
                        is_spinner: false,
                    });
                    lumps.push(Lump::default());
                    Frame {
                        name: solid.name.clone(),
                        body: bodies.len() - 1,
                        position: Vector3::zeros(),
                        rotation: Matrix3::identity(),
                    }
                }
            } else {
                bodies.push(Body {
                    name: solid.name.clone(),
                    parent: 0,
                    position: Vector3::zeros(),
                    rotation: None,
                    axis,
                    mass: 0.0,
                    centre_of_mass: Vector3::zeros(),
                    principal_inertia: Vector3::zeros(),
                    principal_axes: None,
                    hold: Hold {
                        stiffness: 0.0,
                        damping: 0.0,
                    },
                    is_spinner: false,
                });
                lumps.push(Lump::default());
                Frame {
                    name: solid.name.clone(),
                    body: 0,
                    position: Vector3::zeros(),
                    rotation: Matrix3::identity(),
                }
            };
            let centre = frame.position
                + frame.rotation * Vector3::from(solid.centre_of_mass.unwrap_or_default());
            let about_centre = frame.rotation
                * solid_inertia(solid.mass, &solid.shape, solid.inertia)
                * frame.rotation.transpose();
            let lump = &mut lumps[frame.body];
            lump.mass += solid.mass;
            lump.moment += centre * solid.mass;
            lump.inertia +=
                about_centre + SymmetricMatrix3::point_mass(solid.mass, &centre).to_matrix();
            if let (true, Shape::Box { size }) = (solid.collides, solid.shape) {
                boxes.push(CollisionBox {
                    body: frame.body,
                    name: solid.name.clone(),
                    centre,
                    rotation: frame.rotation,
                    half_size: Vector3::from(size) * 0.5,
                });
            }
            if let (true, Shape::Sphere { radius }) = (solid.collides, solid.shape) {
                spheres.push(CollisionSphere {
                    body: frame.body,
                    name: solid.name.clone(),
                    centre,
                    radius,
                });
            }
            frames.push(frame);
        }
        for (body, lump) in bodies.iter_mut().zip(&lumps) {
            body.mass = lump.mass;
            body.centre_of_mass = lump.moment / lump.mass;
            let steiner = SymmetricMatrix3::point_mass(lump.mass, &body.centre_of_mass).to_matrix();
            let about = SymmetricMatrix3::from_matrix(&(lump.inertia - steiner));
            let off = about.xy.abs() + about.xz.abs() + about.yz.abs();
            if off <= 1e-14 * (about.xx + about.yy + about.zz) {
                body.principal_inertia = Vector3::new(about.xx, about.yy, about.zz);
            } else {
                let eigen = about.to_matrix().symmetric_eigen();
                body.principal_inertia = eigen.eigenvalues;
                body.principal_axes = Some(eigen.eigenvectors);
            }
        }
        let joints: HashMap<&str, usize> = (bodies.iter().skip(1).map(|b| b.name.as_str()))
            .zip(0..)
            .collect();
        let joint_of = |name: &str| joints.get(name).copied();
        let mut wheels = Vec::new();
        for wheel in &description.wheels {
            let Some(frame) = index_of
                .get(wheel.solid.as_str())
                .map(|&k| frames[k].clone())
            else {
                continue;
            };
            let axle = frame.rotation * Vector3::from(wheel.axle).normalize();
            wheels.push(Wheel {
                name: wheel.name.clone(),
                body: frame.body,
                centre: frame.position,
                axle,
                spoke: perpendicular(&axle),
                radius: wheel.contact_radius.unwrap_or(wheel.radius),
                torque_limit: wheel.torque_limit,
                drive_sign: wheel.drive_sign,
                motor: wheel.motor,
                joint: joint_of(&wheel.solid),
                steering: wheel.steering.as_deref().and_then(joint_of),
                steering_limit: wheel.steering_limit.unwrap_or(0.0),
            });
        }
        let carriers = (boxes.iter().map(|x| x.body)).chain(spheres.iter().map(|x| x.body));
        mark_spinners(&mut bodies, &wheels, carriers);
        Self::with_tree(description, bodies, frames, wheels, (boxes, spheres))
    }

    fn with_tree(
        description: ModelDescription,
        bodies: Vec<Body>,
        frames: Vec<Frame>,
        wheels: Vec<Wheel>,
        (boxes, spheres): (Vec<CollisionBox>, Vec<CollisionSphere>),
    ) -> Self {
        let mut path_of: Vec<Vec<usize>> = vec![(0..6).collect()];
        for (b, body) in bodies.iter().enumerate().skip(1) {
            let mut path = path_of[body.parent].clone();
            path.push(5 + b);
            path_of.push(path);
        }
        let path_lengths: Vec<usize> = path_of.iter().map(Vec::len).collect();
        let path_stride = path_lengths.iter().copied().max().unwrap_or(6);
        let mut paths = vec![0; bodies.len() * path_stride];
        for (b, path) in path_of.iter().enumerate() {
            paths[b * path_stride..][..path.len()].copy_from_slice(path);
        }
        let motions = paths.iter().map(|k| k.saturating_sub(BASE)).collect();
        let joint_velocities = (BASE..5 + bodies.len()).collect();
        let joint_bodies = 1..bodies.len();
        let body_of_velocity = [0; BASE].into_iter().chain(joint_bodies).collect();
        // A path ends with its own body, which no path of a body before it has: what both share is what the parent shares.
        let n = bodies.len();
        let mut common = vec![0; n * n];
        for a in 0..n {
            common[a * n + a] = path_lengths[a];
            for b in 0..a {
                let shared = common[bodies[a].parent * n + b];
                common[a * n + b] = shared;
                common[b * n + a] = shared;
            }
        }
        let mass = bodies.iter().map(|b| b.mass).sum();
        let reach = bodies.iter().map(|b| b.position.norm()).sum();
        let (spinning, turning) = (BASE..5 + bodies.len()).partition(|k| bodies[k - 5].is_spinner);
        let text = description.to_json().unwrap_or_default();
        let fingerprint = fingerprint(text.bytes());
        Self {
            description,
            bodies,
            frames,
            wheels,
            boxes,
            spheres,
            paths,
            path_lengths,
            path_stride,
            motions,
            joint_velocities,
            body_of_velocity,
            common,
            mass,
            reach,
            spinning,
            turning,
            fingerprint,
        }
    }

    /// The description that it was built from.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Moving bodies; the first is the base.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
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

    /// Boxes that touch the ground.
    #[must_use]
    pub fn boxes(&self) -> &[CollisionBox] {
        &self.boxes
    }

    /// Balls that touch the ground.
    #[must_use]
    pub fn spheres(&self) -> &[CollisionSphere] {
        &self.spheres
    }

    /// Whether parts of two bodies can touch: in one machine only where it has self-contact, and not across a joint.
    #[must_use]
    pub fn can_touch(&self, a: usize, b: usize) -> bool {
        let is_joined = self.bodies[a].parent == b || self.bodies[b].parent == a;
        a != b && !is_joined && self.description.self_contact
    }

    /// Number of velocities: 6 + free joints.
    #[must_use]
    pub fn nv(&self) -> usize {
        5 + self.bodies.len()
    }

    /// Number of free joints.
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.bodies.len() - 1
    }

    /// A number that two models share only if they have the same description and the same locked joints.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Total mass, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// How far a joint can be from the trunk's origin at most, m.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Velocity indices of the joints whose turning changes only looks: see [`Body::is_spinner`].
    #[must_use]
    pub fn spinning_joints(&self) -> &[usize] {
        &self.spinning
    }

    /// Velocity indices of all other joints.
    #[must_use]
    pub fn turning_joints(&self) -> &[usize] {
        &self.turning
    }

    /// Velocity indices that move body `b`, base first.
    #[inline]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        &self.paths[b * self.path_stride..][..self.path_lengths[b]]
    }

    /// Velocity indices from the base to velocity `k` itself.
    #[inline]
    #[must_use]
    pub(crate) fn velocity_path(&self, k: usize) -> &[usize] {
        if k < BASE {
            &self.paths[..=k]
        } else {
            self.path(self.body_of_velocity[k])
        }
    }

    /// Longest path: the stride of everything that is stored along paths.
    #[inline]
    #[must_use]
    pub fn path_stride(&self) -> usize {
        self.path_stride
    }

    /// How many leading path entries two bodies share.
    #[inline]
    #[must_use]
    pub fn common_path(&self, a: usize, b: usize) -> usize {
        self.common[a * self.bodies.len() + b]
    }

    /// How many velocities of a free base begin the path of body `b`: 6, or 0 in a tree on a fixed base.
    #[inline]
    #[must_use]
    pub fn lead(&self, _b: usize) -> usize {
        BASE
    }

    /// Body whose joint has velocity `k`.
    #[inline]
    #[must_use]
    pub fn body_of_velocity(&self, k: usize) -> usize {
        self.body_of_velocity[k]
    }

    /// The path of body `b` in two parts: the velocities of a free base, which are consecutive, and those of the joints.
    #[inline]
    #[must_use]
    pub fn split_path(&self, b: usize) -> (Range<usize>, &[usize]) {
        (0..BASE, &self.path(b)[BASE..])
    }

    /// The motions ([`Kinematics::motions`](super::Kinematics::motions)) that the velocities of body `b`'s path beyond its
    /// [`Self::lead`] give it, in the order of the path.
    #[inline]
    #[must_use]
    pub fn motions(&self, b: usize) -> &[usize] {
        &self.motions[b * self.path_stride..][BASE..self.path_lengths[b]]
    }

    /// Number of a joint by name: its index in commands and in [`Configuration::joints`](super::Configuration::joints).
    #[must_use]
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.bodies.iter().skip(1).position(|b| b.name == name)
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
        self.bodies[joint + 1].hold
    }
}

/// FNV-1a over what tells models apart; the same on every machine and in every version.
pub(crate) fn fingerprint(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Finds the bodies whose own rotation is only looks.
fn mark_spinners(bodies: &mut [Body], wheels: &[Wheel], carriers: impl Iterator<Item = usize>) {
    let carriers: HashSet<usize> = (bodies.iter().skip(1).map(|b| b.parent))
        .chain(carriers)
        .collect();
    let mut wheels_of: HashMap<usize, Vec<&Wheel>> = HashMap::new();
    for wheel in wheels {
        wheels_of.entry(wheel.body).or_default().push(wheel);
    }
    for b in 1..bodies.len() {
        let body = &bodies[b];
        let along = |x: &Vector3<f64>| x.cross(&body.axis.direction()).norm() < 1e-12;
        let (axis, I) = (body.axis.direction(), body.principal_inertia);
        let across = match body.axis {
            JointAxis::X => [I.y, I.z],
            JointAxis::Y => [I.x, I.z],
            JointAxis::Z => [I.x, I.y],
            JointAxis::General(_) => [f64::NAN; 2],
        };
        let is_symmetric =
            body.principal_axes.is_none() && (across[0] - across[1]).abs() <= 1e-14 * I.sum();
        let is_leaf = !carriers.contains(&b);
        let wheels_spin =
            (wheels_of.get(&b).into_iter().flatten()).all(|w| along(&w.centre) && along(&w.axle));
        let is_spinner = is_leaf
            && is_symmetric
            && wheels_spin
            && along(&body.centre_of_mass)
            && axis.norm() > 0.0;
        bodies[b].is_spinner = is_spinner;
    }
}

/// Inertia about the mass centre in the solid's frame, kg m².
fn solid_inertia(mass: f64, shape: &Shape, given: Option<[f64; 6]>) -> Matrix3<f64> {
    match given {
        Some([xx, yy, zz, xy, xz, yz]) => SymmetricMatrix3 {
            xx,
            yy,
            zz,
            xy,
            xz,
            yz,
        }
        .to_matrix(),
        None => Matrix3::from_diagonal(&shape.inertia(mass).into()),
    }
}

/// Some unit vector perpendicular to a unit vector.
fn perpendicular(axle: &Vector3<f64>) -> Vector3<f64> {
    let e = if axle.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    Rotation3::face_towards(axle, &e) * -Vector3::x()
}

/// Finite, and at most `limit` either way.
fn in_range(field: &str, value: f64, limit: f64, range: &'static str) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value.abs() <= limit {
        return Ok(());
    }
    Err(ModelError::OutOfRange {
        field: field.to_owned(),
        range,
        value,
    })
}

/// A length that is positive, m.
fn length(field: &str, value: f64) -> Result<(), ModelError> {
    positive(field, value)?;
    if (1e-6..=MAX_LENGTH).contains(&value) {
        return Ok(());
    }
    Err(ModelError::OutOfRange {
        field: field.to_owned(),
        range: "from 1e-6 to 1e6 m",
        value,
    })
}

/// A place, m.
fn place(field: &str, values: &[f64; 3]) -> Result<(), ModelError> {
    (values.iter()).try_for_each(|&x| in_range(field, x, MAX_LENGTH, "at most 1e6 m either way"))
}

/// A gain, a torque or an inertia: not negative, and no larger than a double can carry through a step.
fn moderate(field: &str, value: f64) -> Result<(), ModelError> {
    not_negative(field, value)?;
    in_range(field, value, 1e18, "at most 1e18")
}

fn finite(field: &str, values: &[f64]) -> Result<(), ModelError> {
    values.iter().try_for_each(|&value| {
        if value.is_finite() {
            Ok(())
        } else {
            Err(ModelError::NotFinite {
                field: field.to_owned(),
                value,
            })
        }
    })
}

fn positive(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value > 0.0 {
        Ok(())
    } else {
        Err(ModelError::NotPositive {
            field: field.to_owned(),
            value,
        })
    }
}

fn not_negative(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value >= 0.0 {
        Ok(())
    } else {
        Err(ModelError::Negative {
            field: field.to_owned(),
            value,
        })
    }
}

fn direction(field: &str, value: [f64; 3]) -> Result<(), ModelError> {
    finite(field, &value)?;
    if Unit::try_new(Vector3::from(value), 1e-9).is_some() {
        Ok(())
    } else {
        Err(ModelError::NoDirection {
            field: field.to_owned(),
            value,
        })
    }
}

/// Everything that a description must satisfy, in the order of its text.
fn check(description: &ModelDescription) -> Result<(), ModelError> {
    if description.solids.is_empty() {
        return Err(ModelError::NoSolids);
    }
    for (field, count) in [
        ("solids", description.solids.len()),
        ("wheels", description.wheels.len()),
        ("tags", description.tags.len()),
    ] {
        if count > MAX_SOLIDS {
            return Err(ModelError::TooMany {
                field,
                what: field,
                count,
                limit: MAX_SOLIDS,
            });
        }
    }
    let mut solids: HashMap<&str, usize> = HashMap::new();
    for (i, solid) in description.solids.iter().enumerate() {
        if solids.contains_key(solid.name.as_str()) {
            return Err(ModelError::DuplicateName {
                field: format!("solids[{i}].name"),
                name: solid.name.clone(),
            });
        }
        check_joint(i, solid, &solids)?;
        check_body(i, solid)?;
        solids.insert(&solid.name, i);
    }
    check_wheels(description, &solids)?;
    check_tags(description, &solids)
}

/// What carries a solid. `before`: the solids listed before it.
fn check_joint(
    i: usize,
    solid: &SolidDescription,
    before: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    if i == 0 {
        let given = [
            (solid.parent.is_some(), "parent"),
            (solid.position.is_some(), "position"),
            (solid.axis.is_some(), "axis"),
            (solid.hold.is_some(), "hold"),
            (solid.locked.is_some(), "locked"),
        ];
        return match given.iter().find(|(is_given, _)| *is_given) {
            Some((_, what)) => Err(ModelError::NotForBase {
                field: at(what),
                what,
            }),
            None => Ok(()),
        };
    }
    let missing = |what: &str| ModelError::Missing { field: at(what) };
    let parent = solid.parent.as_ref().ok_or_else(|| missing("parent"))?;
    if !before.contains_key(parent.as_str()) {
        return Err(ModelError::UnknownParent {
            field: at("parent"),
            name: parent.clone(),
        });
    }
    direction(&at("axis"), solid.axis.ok_or_else(|| missing("axis"))?)?;
    let position = solid.position.ok_or_else(|| missing("position"))?;
    place(&at("position"), &position)?;
    if let Some(angle) = solid.locked {
        in_range(&at("locked"), angle, 1e9, "at most 1e9 rad")?;
    }
    if let Some(hold) = solid.hold {
        moderate(&at("hold.stiffness"), hold.stiffness)?;
        moderate(&at("hold.damping"), hold.damping)?;
    }
    Ok(())
}

/// Mass, shape and inertia of a solid.
fn check_body(i: usize, solid: &SolidDescription) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    positive(&at("mass"), solid.mass)?;
    if !(1e-9..=1e12).contains(&solid.mass) {
        return Err(ModelError::OutOfRange {
            field: at("mass"),
            range: "from 1e-9 to 1e12 kg",
            value: solid.mass,
        });
    }
    match solid.shape {
        Shape::Box { size } => size
            .iter()
            .try_for_each(|&s| length(&at("shape.size"), s))?,
        Shape::Cylinder { radius, height } => {
            length(&at("shape.radius"), radius)?;
            length(&at("shape.height"), height)?;
        }
        Shape::Disc { radius } | Shape::Sphere { radius } => {
            length(&at("shape.radius"), radius)?;
        }
    }
    place(
        &at("centre_of_mass"),
        &solid.centre_of_mass.unwrap_or_default(),
    )?;
    for entry in solid.inertia.iter().flatten() {
        in_range(&at("inertia"), *entry, 1e24, "at most 1e24 kg m²")?;
    }
    let principal = solid_inertia(solid.mass, &solid.shape, solid.inertia).symmetric_eigenvalues();
    let (sum, largest) = (principal.sum(), principal.max());
    if principal.min() <= 0.0 || largest > (sum - largest) * (1.0 + 1e-9) {
        return Err(ModelError::ImpossibleInertia {
            field: at("inertia"),
            principal: principal.into(),
        });
    }
    if solid.collides && !matches!(solid.shape, Shape::Box { .. } | Shape::Sphere { .. }) {
        return Err(ModelError::CollidesWithoutBox {
            field: at("collides"),
        });
    }
    Ok(())
}

fn check_tags(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, tag) in description.tags.iter().enumerate() {
        let at = |what: &str| format!("tags[{i}].{what}");
        if solids.contains_key(tag.name.as_str()) || !names.insert(tag.name.as_str()) {
            return Err(ModelError::DuplicateName {
                field: at("name"),
                name: tag.name.clone(),
            });
        }
        if !solids.contains_key(tag.solid.as_str()) {
            return Err(ModelError::UnknownName {
                field: at("solid"),
                name: tag.solid.clone(),
            });
        }
        place(&at("position"), &tag.position)?;
    }
    Ok(())
}

fn check_wheels(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, wheel) in description.wheels.iter().enumerate() {
        let at = |what: &str| format!("wheels[{i}].{what}");
        if !names.insert(wheel.name.as_str()) {
            return Err(ModelError::DuplicateName {
                field: at("name"),
                name: wheel.name.clone(),
            });
        }
        let find = |field: &str, name: &String| {
            let found = solids.get(name.as_str()).copied();
            found.ok_or_else(|| ModelError::UnknownName {
                field: at(field),
                name: name.clone(),
            })
        };
        let mut solid = find("solid", &wheel.solid)?;
        direction(&at("axle"), wheel.axle)?;
        length(&at("radius"), wheel.radius)?;
        if let Some(radius) = wheel.contact_radius {
            length(&at("contact_radius"), radius)?;
        }
        if let Shape::Disc { radius } = description.solids[solid].shape
            && (radius - wheel.radius).abs() > 1e-9 * radius
        {
            return Err(ModelError::RadiusContradictsShape {
                field: at("radius"),
                value: wheel.radius,
                solid: wheel.solid.clone(),
                shape: radius,
            });
        }
        moderate(&at("torque_limit"), wheel.torque_limit)?;
        finite(&at("drive_sign"), &[wheel.drive_sign])?;
        if (wheel.drive_sign.abs() - 1.0).abs() > 0.0 {
            return Err(ModelError::NotASign {
                field: at("drive_sign"),
                value: wheel.drive_sign,
            });
        }
        if let Some(motor) = wheel.motor {
            motor.check(|field| at(&format!("motor.{field}")))?;
        }
        if let Some(name) = &wheel.steering {
            let steering = find("steering", name)?;
            // Parents come before their children, so the way up ends.
            while solid > steering {
                let parent = description.solids[solid].parent.as_deref();
                solid = parent.and_then(|p| solids.get(p).copied()).unwrap_or(0);
            }
            if solid != steering || steering == 0 {
                return Err(ModelError::SteeringNotAbove {
                    field: at("steering"),
                    name: name.clone(),
                });
            }
            let Some(limit) = wheel.steering_limit else {
                return Err(ModelError::Missing {
                    field: at("steering_limit"),
                });
            };
            moderate(&at("steering_limit"), limit)?;
        }
    }
    Ok(())
}
