//! The checked, immutable model: moving bodies, their tree, wheels and frames.
//!
//! Built once from a [`ModelDescription`], shared between threads, never changed. A locked (welded)
//! joint leaves no trace: the inertia of its solid is merged into the body that carries it and its
//! coordinate is gone from every matrix.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::description::{Hold, ModelDescription, Shape};
use super::error::ModelError;
use super::joint::JointAxis;
use super::motor::Motor;
use crate::spatial::SymmetricMatrix3;

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
    /// Velocity index of the wheel's own joint; none where it is locked.
    pub joint: Option<usize>,
    /// Velocity index of its steering joint; none where there is none or it is locked.
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

/// A tree of bodies under a free base. Velocity: 3 linear (trunk origin, world), 3 angular (world), joint rates.
#[derive(Clone, Debug)]
pub struct Model {
    description: ModelDescription,
    locked: Vec<(String, f64)>,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    wheels: Vec<Wheel>,
    boxes: Vec<CollisionBox>,
    /// Velocity indices from the base to body `b`: `paths[b * path_stride ..][.. path_lengths[b]]`.
    paths: Vec<usize>,
    path_lengths: Vec<usize>,
    path_stride: usize,
    /// How many leading path entries bodies `a` and `b` share: `common[a * n_bodies + b]`.
    common: Vec<usize>,
    mass: f64,
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
    /// Checks a description and builds the tree with all joints free.
    ///
    /// # Errors
    /// The first thing found wrong, naming its field.
    pub fn from_description(description: ModelDescription) -> Result<Self, ModelError> {
        Self::build(description, Vec::new())
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
        let mut locked = self.locked.clone();
        for (i, (name, angle)) in joints.iter().enumerate() {
            let is_joint = self
                .description
                .solids
                .iter()
                .skip(1)
                .any(|s| &s.name == name);
            if !is_joint {
                return Err(ModelError::UnknownName {
                    field: format!("joints[{i}]"),
                    name: name.clone(),
                });
            }
            if !angle.is_finite() {
                return Err(ModelError::NotFinite {
                    field: format!("joints[{name}]"),
                    value: *angle,
                });
            }
            locked.retain(|(n, _)| n != name);
            locked.push((name.clone(), *angle));
        }
        Self::build(self.description.clone(), locked)
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
        Self::build(description, self.locked.clone())
    }

    #[allow(clippy::too_many_lines)] // one pass over the solids; its parts share every local
    fn build(
        description: ModelDescription,
        locked: Vec<(String, f64)>,
    ) -> Result<Self, ModelError> {
        check(&description)?;
        let mut bodies: Vec<Body> = Vec::new();
        let mut lumps: Vec<Lump> = Vec::new();
        let mut frames: Vec<Frame> = Vec::new();
        let mut boxes = Vec::new();
        let index_of = |frames: &[Frame], name: &str| frames.iter().position(|f| f.name == name);
        for (i, solid) in description.solids.iter().enumerate() {
            let axis = solid
                .axis
                .and_then(|a| JointAxis::from_direction(&a.into()))
                .unwrap_or(JointAxis::X);
            let lock = locked
                .iter()
                .find(|(n, _)| *n == solid.name)
                .map(|(_, angle)| *angle);
            let parent = solid.parent.as_deref().and_then(|p| index_of(&frames, p));
            let frame = if let (Some(p), true) = (parent, i > 0) {
                let carrier: Frame = frames[p].clone();
                let position = carrier.position
                    + carrier.rotation * Vector3::from(solid.position.unwrap_or_default());
                if let Some(angle) = lock {
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
        let mut wheels = Vec::new();
        for wheel in &description.wheels {
            let Some(frame) = index_of(&frames, &wheel.solid).map(|k| frames[k].clone()) else {
                continue;
            };
            let joint_of = |name: &str| {
                bodies
                    .iter()
                    .skip(1)
                    .position(|b| b.name == name)
                    .map(|k| k + 6)
            };
            let axle = frame.rotation * Vector3::from(wheel.axle).normalize();
            wheels.push(Wheel {
                name: wheel.name.clone(),
                body: frame.body,
                centre: frame.position,
                axle,
                spoke: perpendicular(&axle),
                radius: wheel.radius,
                torque_limit: wheel.torque_limit,
                drive_sign: wheel.drive_sign,
                motor: wheel.motor,
                joint: joint_of(&wheel.solid),
                steering: wheel.steering.as_deref().and_then(joint_of),
                steering_limit: wheel.steering_limit.unwrap_or(0.0),
            });
        }
        mark_spinners(&mut bodies, &wheels, &boxes);
        Ok(Self::with_tree(
            description,
            locked,
            bodies,
            frames,
            wheels,
            boxes,
        ))
    }

    fn with_tree(
        description: ModelDescription,
        locked: Vec<(String, f64)>,
        bodies: Vec<Body>,
        frames: Vec<Frame>,
        wheels: Vec<Wheel>,
        boxes: Vec<CollisionBox>,
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
        let mut common = vec![0; bodies.len() * bodies.len()];
        for (a, path_a) in path_of.iter().enumerate() {
            for (b, path_b) in path_of.iter().enumerate() {
                common[a * bodies.len() + b] = path_a
                    .iter()
                    .zip(path_b)
                    .take_while(|(i, j)| i == j)
                    .count();
            }
        }
        let mass = bodies.iter().map(|b| b.mass).sum();
        let fingerprint = fingerprint(&description, &locked);
        Self {
            description,
            locked,
            bodies,
            frames,
            wheels,
            boxes,
            paths,
            path_lengths,
            path_stride,
            common,
            mass,
            fingerprint,
        }
    }

    /// The description that it was built from.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Locked joints with their angles (rad).
    #[must_use]
    pub fn locked_joints(&self) -> &[(String, f64)] {
        &self.locked
    }

    /// Moving bodies; the first is the base, body `b > 0` has velocity index `5 + b`.
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

    /// Velocity indices that move body `b`, base first.
    #[inline]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        &self.paths[b * self.path_stride..][..self.path_lengths[b]]
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

    /// Velocity index of a joint by name.
    #[must_use]
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.bodies
            .iter()
            .skip(1)
            .position(|b| b.name == name)
            .map(|k| k + 6)
    }
}

/// FNV-1a over what tells models apart; the same on every machine and in every version.
fn fingerprint(description: &ModelDescription, locked: &[(String, f64)]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let text = description.to_json().unwrap_or_default();
    let angles = locked
        .iter()
        .flat_map(|(name, angle)| name.bytes().chain(angle.to_bits().to_le_bytes()));
    for byte in text.bytes().chain(angles) {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    hash
}

/// Finds the bodies whose own rotation is only looks.
fn mark_spinners(bodies: &mut [Body], wheels: &[Wheel], boxes: &[CollisionBox]) {
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
        let is_leaf = bodies.iter().skip(1).all(|other| other.parent != b)
            && boxes.iter().all(|x| x.body != b);
        let wheels_spin = wheels
            .iter()
            .filter(|w| w.body == b)
            .all(|w| along(&w.centre) && along(&w.axle));
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
    for (i, solid) in description.solids.iter().enumerate() {
        let at = |what: &str| format!("solids[{i}].{what}");
        let before = &description.solids[..i];
        if before.iter().any(|s| s.name == solid.name) {
            return Err(ModelError::DuplicateName {
                field: at("name"),
                name: solid.name.clone(),
            });
        }
        if i == 0 {
            for (is_given, what) in [
                (solid.parent.is_some(), "parent"),
                (solid.position.is_some(), "position"),
                (solid.axis.is_some(), "axis"),
                (solid.hold.is_some(), "hold"),
            ] {
                if is_given {
                    return Err(ModelError::NotForBase {
                        field: at(what),
                        what,
                    });
                }
            }
        } else {
            let Some(parent) = &solid.parent else {
                return Err(ModelError::Missing {
                    field: at("parent"),
                });
            };
            if !before.iter().any(|s| s.name == *parent) {
                return Err(ModelError::UnknownParent {
                    field: at("parent"),
                    name: parent.clone(),
                });
            }
            let Some(axis) = solid.axis else {
                return Err(ModelError::Missing { field: at("axis") });
            };
            direction(&at("axis"), axis)?;
            let Some(position) = solid.position else {
                return Err(ModelError::Missing {
                    field: at("position"),
                });
            };
            finite(&at("position"), &position)?;
        }
        positive(&at("mass"), solid.mass)?;
        match solid.shape {
            Shape::Box { size } => size
                .iter()
                .try_for_each(|&s| positive(&at("shape.size"), s))?,
            Shape::Cylinder { radius, height } => {
                positive(&at("shape.radius"), radius)?;
                positive(&at("shape.height"), height)?;
            }
            Shape::Disc { radius } => positive(&at("shape.radius"), radius)?,
        }
        finite(
            &at("centre_of_mass"),
            &solid.centre_of_mass.unwrap_or_default(),
        )?;
        if let Some(inertia) = solid.inertia {
            finite(&at("inertia"), &inertia)?;
        }
        let principal =
            solid_inertia(solid.mass, &solid.shape, solid.inertia).symmetric_eigenvalues();
        let (sum, largest) = (principal.sum(), principal.max());
        if principal.min() <= 0.0 || largest > (sum - largest) * (1.0 + 1e-9) {
            return Err(ModelError::ImpossibleInertia {
                field: at("inertia"),
                principal: principal.into(),
            });
        }
        if let Some(hold) = solid.hold {
            not_negative(&at("hold.stiffness"), hold.stiffness)?;
            not_negative(&at("hold.damping"), hold.damping)?;
        }
        if solid.collides && !matches!(solid.shape, Shape::Box { .. }) {
            return Err(ModelError::CollidesWithoutBox {
                field: at("collides"),
            });
        }
    }
    check_wheels(description)?;
    check_tags(description)
}

fn check_tags(description: &ModelDescription) -> Result<(), ModelError> {
    for (i, tag) in description.tags.iter().enumerate() {
        let at = |what: &str| format!("tags[{i}].{what}");
        let is_taken = description.tags[..i].iter().any(|t| t.name == tag.name)
            || description.solids.iter().any(|s| s.name == tag.name);
        if is_taken {
            return Err(ModelError::DuplicateName {
                field: at("name"),
                name: tag.name.clone(),
            });
        }
        if !description.solids.iter().any(|s| s.name == tag.solid) {
            return Err(ModelError::UnknownName {
                field: at("solid"),
                name: tag.solid.clone(),
            });
        }
        finite(&at("position"), &tag.position)?;
    }
    Ok(())
}

fn check_wheels(description: &ModelDescription) -> Result<(), ModelError> {
    let solids = &description.solids;
    for (i, wheel) in description.wheels.iter().enumerate() {
        let at = |what: &str| format!("wheels[{i}].{what}");
        if description.wheels[..i].iter().any(|w| w.name == wheel.name) {
            return Err(ModelError::DuplicateName {
                field: at("name"),
                name: wheel.name.clone(),
            });
        }
        let find = |name: &str| solids.iter().position(|s| s.name == name);
        let Some(mut solid) = find(&wheel.solid) else {
            return Err(ModelError::UnknownName {
                field: at("solid"),
                name: wheel.solid.clone(),
            });
        };
        direction(&at("axle"), wheel.axle)?;
        positive(&at("radius"), wheel.radius)?;
        not_negative(&at("torque_limit"), wheel.torque_limit)?;
        finite(&at("drive_sign"), &[wheel.drive_sign])?;
        if (wheel.drive_sign.abs() - 1.0).abs() > 0.0 {
            return Err(ModelError::NotASign {
                field: at("drive_sign"),
                value: wheel.drive_sign,
            });
        }
        if let Some(motor) = wheel.motor {
            positive(&at("motor.stall_torque"), motor.stall_torque)?;
            positive(&at("motor.no_load_speed"), motor.no_load_speed)?;
        }
        if let Some(name) = &wheel.steering {
            let Some(steering) = find(name) else {
                return Err(ModelError::UnknownName {
                    field: at("steering"),
                    name: name.clone(),
                });
            };
            while let (Some(parent), true) = (&solids[solid].parent, solid != steering) {
                solid = find(parent).unwrap_or(0);
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
            not_negative(&at("steering_limit"), limit)?;
        }
    }
    Ok(())
}
