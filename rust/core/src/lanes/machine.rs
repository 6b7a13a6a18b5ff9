//! The machine that all rovers of a block share: its tree, its wheels and its boxes.
//!
//! Body 0 is the trunk, on the free base. Every other body has a joint of the catalogue
//! ([`crate::multibody::joint`]). Bodies, velocities, motions and joints are numbered as in the
//! model. A *row* is a velocity of a joint, counted from the first after the base: row j is
//! velocity `j + 6`. Lengths are in m.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::pattern::Pattern;
use super::problem::MAX_CONTACTS;
use crate::contact::Part;
#[cfg(doc)]
use crate::geometry::Roller;
use crate::law::compliance::Compliance;
use crate::multibody::description::Limits;
use crate::multibody::joint::{Coordinate, Joint, JointAxis, Prismatic, Revolute, Spherical};
use crate::multibody::model::BASE;
use crate::multibody::{Body, JointProperties, Model, Wheel};
use crate::scalar::elementary::hypot;
use crate::scalar::{Lane, Mat3, Vec3};

/// Most wheels and joints with stops: the operator of a block has room for contacts of all of them.
pub const MOST_PARTS: usize = 32;

/// Slots of a joint with stops.
pub const SIDES: usize = 2;

/// Why a machine has no fast step.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Unsupported {
    /// It has several trees, or its root is fixed.
    #[error("the machine is not one tree on a free base")]
    NotOneFreeTree,
    /// Its wheels and stops can have more contacts than a problem.
    #[error("wheels with a width and stops can have {0} contacts, more than {MAX_CONTACTS}")]
    TooManyContacts(usize),
    /// It has more wheels and joints with stops than lanes have room for.
    #[error("the machine has {0} wheels and joints with stops, more than {MOST_PARTS}")]
    TooManyParts(usize),
}

/// What a block of rovers has in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// The bodies, carriers before what they carry; the first is the trunk.
    pub links: Vec<Link>,
    /// Wheels, in the model's order.
    pub wheels: Vec<WheelDisc>,
    /// Boxes and balls that collide with the ground, in the model's order.
    pub boxes: Vec<BodyBox>,
    /// Joints with a coordinate of their own, in the model's order.
    pub joints: Vec<OwnJoint>,
    /// Joints with stops, ascending.
    pub stops: Vec<Stop>,
    /// Slots between those of the wheels and the stops: [`Self::find_spares`].
    pub(super) spares: Vec<Option<usize>>,
    /// Whether its bodies can touch each other.
    pub(super) has_pairs: bool,
    /// Joints with springs or dampers, and joints with rotors, ascending.
    pub(super) passive: Vec<usize>,
    pub(super) rotors: Vec<usize>,
    /// Bodies with coupled joints, ascending.
    pub(super) coupled: Vec<usize>,
    /// Velocities of the spherical joints.
    pub(super) balls: Vec<usize>,
    /// Velocities that turn a frame and their rates per unit, and velocities of the spinners.
    pub(super) turning: Vec<(usize, f64)>,
    pub(super) spinning: Vec<usize>,
    /// Coordinates of the joints that a step turns, in the order of the bodies, and how those of
    /// coupled joints follow from them.
    pub(super) angles: Vec<usize>,
    pub(super) coupled_angles: Vec<(usize, Ratio)>,
    /// Of each row, where its entries are.
    pub(super) rows: Vec<Range<usize>>,
    /// The columns of each row in the mass matrix, row after row: the rows of the velocities that
    /// precede it on its path, then its own.
    pub(super) columns: Vec<usize>,
    /// The motion of each of these columns.
    pub(super) column_motions: Vec<usize>,
    n_motions: usize,
    paths: Vec<usize>,
    movers: Vec<Mover>,
    /// Pattern of its contact problems; none if they cannot be solved by the factors of their
    /// operator.
    pub(super) pattern: Option<Arc<Pattern>>,
}

/// A joint with a coordinate of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnJoint {
    /// The body that it carries.
    pub body: usize,
    /// Its velocity.
    pub velocity: usize,
}

/// A joint with stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Index of the joint.
    pub joint: usize,
    /// Its range, rad or m.
    pub limits: Limits,
}

/// A velocity that moves a body, and the motion that a unit of it imparts to the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mover {
    /// Index among all velocities.
    pub velocity: usize,
    /// Index in [`super::poses::Poses::motions`].
    pub motion: usize,
}

/// A linear function of a coordinate: that of a coupled joint, `ratio q + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Per unit of the joint that it follows.
    pub ratio: f64,
    /// At that joint's zero, rad or m.
    pub offset: f64,
}

/// A body and its joint.
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// The body that carries it; 0 for the trunk itself.
    pub parent: usize,
    /// Origin of the joint in the carrier's frame.
    pub position: [f64; 3],
    /// The axis of the carrier's frame that it lies on.
    pub(super) along: Option<usize>,
    /// Columns of the fixed rotation from the joint's frame to the carrier's; `None` for the
    /// identity.
    pub rotation: Option<[[f64; 3]; 3]>,
    /// Its joint.
    pub joint: LinkJoint,
    /// Axis of a revolute or prismatic joint, the same in the joint's frame and the body's.
    pub axis: Axis,
    /// How the joint follows another one.
    pub coupling: Option<Coupled>,
    /// Its first velocity, or the one that it follows, and its first motion.
    pub velocity: usize,
    /// See above.
    pub motion: usize,
    /// Whether a step need not turn it: [`Body::is_spinner`].
    pub is_spinner: bool,
    /// Whether it carries no other body.
    pub is_leaf: bool,
    /// Whether, besides, its joint follows no other one.
    pub(super) is_plain_leaf: bool,
    /// Whether its carrier carries no body with a higher index.
    pub is_last: bool,
    /// Whether its mass centre is its frame's origin.
    pub is_centred: bool,
    /// What is known of its principal axes.
    pub symmetry: Symmetry,
    /// Number of its own velocities; 0 for the trunk and if the joint follows another one.
    pub(super) n_rows: usize,
    /// Where the last row of its path is in [`Machine::columns`].
    row: Range<usize>,
    path: Range<usize>,
    movers: Range<usize>,
}

/// The joint of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkJoint {
    /// The free base.
    Base,
    /// A rotation about its axis by a coordinate of its own.
    Turn,
    /// A rotation about its axis that follows another joint.
    CoupledTurn,
    /// A displacement along its axis, by the coordinate with this index.
    Slide(usize),
    /// Any rotation about a point: the index of its quaternion.
    Ball(usize),
}

/// How a joint follows another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupled {
    /// Its coordinate.
    pub ratio: Ratio,
    /// If it is further along the path of the joint that it follows: the motion of that velocity
    /// for its carrier, and the one for everything that it carries.
    pub combined: Option<(usize, usize)>,
}

/// Direction of a joint's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// x.
    X,
    /// y.
    Y,
    /// z.
    Z,
    /// A unit vector.
    General([f64; 3]),
}

/// Principal axes of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// The frame's axes, with equal moments across x.
    AboutX,
    /// The frame's axes, with equal moments across y.
    AboutY,
    /// The frame's axes, with equal moments across z.
    AboutZ,
    /// The frame's axes, with three moments.
    None,
    /// Other axes than the frame's.
    Turned,
}

/// A wheel: a disc of zero width, or a [`Roller`].
#[derive(Clone, Debug, PartialEq)]
pub struct WheelDisc {
    /// Body that it is fixed to.
    pub body: usize,
    /// Centre in the body's frame.
    pub centre: [f64; 3],
    /// Unit axle in the body's frame.
    pub axle: [f64; 3],
    /// A unit vector in the wheel's plane, body's frame: the rolling direction when axle and normal
    /// define none.
    pub spoke: [f64; 3],
    /// Contact radius.
    pub radius: f64,
    /// Distance of its circles from the middle; 0 if it has one.
    pub half: f64,
    /// Rounding of its edges.
    pub rounding: f64,
    /// Spring and damper where it touches; `None` if it is rigid.
    pub compliance: Option<Compliance>,
}

/// A box that collides with the ground, or that has a ball in it which does.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyBox {
    /// The model's part.
    pub part: Part,
    /// Body that carries it.
    pub body: usize,
    /// Centre in the body's frame.
    pub centre: [f64; 3],
    /// Columns of the rotation from the box's frame to the body's.
    pub rotation: [[f64; 3]; 3],
    /// Half edge lengths.
    pub half_size: [f64; 3],
}

impl Machine {
    /// The machine of a model.
    ///
    /// # Errors
    /// Why it has no fast step.
    pub fn of(model: &Model) -> Result<Self, Unsupported> {
        check(model)?;
        let bodies = model.bodies();
        let mut machine = Self {
            links: Vec::with_capacity(bodies.len()),
            wheels: (model.wheels().iter()).map(WheelDisc::of).collect(),
            boxes: (Part::all(model).skip(model.wheels().len()))
                .map(|part| BodyBox::of(model, part))
                .collect(),
            joints: (model.joints().iter())
                .map(|joint| OwnJoint {
                    body: joint.body,
                    velocity: joint.velocity,
                })
                .collect(),
            stops: (model.limited_joints().iter())
                .filter_map(|&joint| {
                    let limits = model.joints()[joint].limits?;
                    Some(Stop { joint, limits })
                })
                .collect(),
            spares: Vec::new(),
            has_pairs: model.description().self_contact,
            passive: joints_with(model, |joint| joint.is_passive),
            rotors: joints_with(model, |joint| joint.passive.armature > 0.0),
            coupled: model.coupled_bodies().to_vec(),
            balls: Vec::new(),
            turning: Vec::new(),
            spinning: model.spinning_joints().to_vec(),
            angles: Vec::new(),
            coupled_angles: Vec::new(),
            rows: Vec::new(),
            columns: Vec::new(),
            column_motions: Vec::new(),
            n_motions: model.n_motions(),
            paths: Vec::new(),
            movers: Vec::new(),
            pattern: None,
        };
        for k in BASE..model.nv() {
            machine.add_row(model, k);
        }
        for b in 0..bodies.len() {
            machine.add_link(model, b);
        }
        machine.spares = machine.find_spares(machine.has_pairs);
        machine.pattern = machine.find_pattern();
        Ok(machine)
    }

    /// Whether a wheel touches a plane at two points.
    #[must_use]
    pub fn has_lines(&self) -> bool {
        self.wheels.iter().any(|wheel| wheel.n_circles() > 1)
    }

    /// Whether any wheel yields where it touches.
    #[must_use]
    pub fn yields(&self) -> bool {
        self.wheels.iter().any(|wheel| wheel.compliance.is_some())
    }

    /// Adds the row of velocity `k`.
    fn add_row(&mut self, model: &Model, k: usize) {
        let path = &model.velocity_path(k)[BASE..];
        let motions = &model.motions(model.body_of_velocity(k))[..path.len()];
        let first = self.columns.len();
        self.columns.extend(path.iter().map(|&k| k - BASE));
        self.column_motions.extend_from_slice(motions);
        self.rows.push(first..self.columns.len());
    }

    fn add_link(&mut self, model: &Model, b: usize) {
        let (bodies, body) = (model.bodies(), &model.bodies()[b]);
        let (_, rest) = model.split_path(b);
        let last_row = rest.last().map(|&k| self.rows[k - BASE].clone());
        let n_rows = match &body.joint {
            Joint::Free(_) => 0,
            joint => joint.nv(),
        };
        let (path, movers) = (self.paths.len(), self.movers.len());
        self.paths.extend(model.path(b));
        let pairs = rest.iter().zip(model.motions(b));
        (self.movers).extend(pairs.map(|(&velocity, &motion)| Mover { velocity, motion }));
        let mut others = bodies[b + 1..].iter();
        let is_leaf = !others.clone().any(|other| other.parent == Some(b));
        let joint = self.joint_of(body);
        self.links.push(Link {
            parent: body.parent.unwrap_or(0),
            position: body.position.into(),
            along: (0..3).find(|&k| (0..3).all(|i| i == k || body.position[i] == 0.0)),
            rotation: body.rotation.as_ref().map(columns),
            joint,
            axis: body.joint.axis().map_or(Axis::X, Axis::of),
            coupling: body.joint.coordinate().and_then(coupled),
            velocity: body.velocity,
            motion: body.motion,
            is_spinner: body.is_spinner,
            is_leaf,
            is_plain_leaf: is_leaf && !body.is_coupled,
            is_last: !others.any(|other| other.parent == body.parent),
            is_centred: body.is_centred(),
            symmetry: Symmetry::of(body),
            n_rows,
            row: last_row.unwrap_or_default(),
            path: path..self.paths.len(),
            movers: movers..self.movers.len(),
        });
    }

    /// The joint of a body, whose angles and velocities are noted.
    fn joint_of(&mut self, body: &Body) -> LinkJoint {
        match &body.joint {
            Joint::Free(_) | Joint::Fixed => LinkJoint::Base,
            Joint::Revolute(Revolute { coordinate, .. }) => {
                let coupling = coupled(coordinate);
                let rate = coupling.map_or(1.0, |coupling| coupling.ratio.ratio);
                if coupling.is_some() || !body.is_spinner {
                    self.turning.push((body.velocity, rate.abs()));
                }
                if !body.is_spinner {
                    if let Some(Coupled { ratio, .. }) = coupling {
                        self.coupled_angles.push((self.angles.len(), ratio));
                    }
                    self.angles.push(coordinate.joint);
                }
                match coupling {
                    None => LinkJoint::Turn,
                    Some(_) => LinkJoint::CoupledTurn,
                }
            }
            Joint::Prismatic(Prismatic { coordinate, .. }) => LinkJoint::Slide(coordinate.joint),
            Joint::Spherical(Spherical { rotation }) => {
                let k = body.velocity;
                self.balls.push(k);
                self.turning.extend([k, k + 1, k + 2].map(|k| (k, 1.0)));
                LinkJoint::Ball(*rotation)
            }
        }
    }

    /// Whether a model differs from this machine only in its inertias, springs, dampers and rotors,
    /// so that it can be a lane of a block. A joint that gains or loses such an element, a mass
    /// centre that leaves the frame's origin, or moments that are no longer equal, make another
    /// machine.
    #[must_use]
    pub fn fits(&self, model: &Model) -> bool {
        Self::of(model).is_ok_and(|other| other == *self)
    }

    /// Number of bodies.
    #[inline]
    #[must_use]
    pub fn n_bodies(&self) -> usize {
        self.links.len()
    }

    /// Number of joints with a coordinate of their own.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Number of velocities.
    #[inline]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.rows.len() + BASE
    }

    /// Number of motions.
    #[inline]
    #[must_use]
    pub fn n_motions(&self) -> usize {
        self.n_motions
    }

    /// The rows of the velocities that move body `b`, in order; empty for the trunk.
    #[inline(always)]
    pub(super) fn row(&self, b: usize) -> &[usize] {
        &self.columns[self.links[b].row.clone()]
    }

    /// Velocities that move body `b`: those of the base, then of the joints from the trunk
    /// outwards.
    #[inline(always)]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        &self.paths[self.links[b].path.clone()]
    }

    /// The velocities of the joints that move body `b`, from the trunk outwards.
    #[inline(always)]
    #[must_use]
    pub fn movers(&self, b: usize) -> &[Mover] {
        &self.movers[self.links[b].movers.clone()]
    }
}

impl BodyBox {
    fn of(model: &Model, part: Part) -> Self {
        let (rotation, half_size) = match part {
            Part::Box(i) => (model.boxes()[i].rotation, model.boxes()[i].half_size),
            _ => (Matrix3::identity(), Vector3::repeat(part.bound(model))),
        };
        Self {
            part,
            body: part.body(model),
            centre: part.centre(model).into(),
            rotation: columns(&rotation),
            half_size: half_size.into(),
        }
    }
}

impl WheelDisc {
    fn of(wheel: &Wheel) -> Self {
        let is_wide = wheel.is_wide();
        Self {
            body: wheel.body,
            centre: wheel.centre.into(),
            axle: wheel.axle.into(),
            spoke: wheel.spoke.into(),
            radius: wheel.radius,
            half: if is_wide {
                0.5 * wheel.width - wheel.rounding
            } else {
                0.0
            },
            rounding: if is_wide { wheel.rounding } else { 0.0 },
            compliance: wheel.compliance,
        }
    }

    /// Whether it has a width.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.half > 0.0 || self.rounding > 0.0
    }

    /// Number of its slots for contacts.
    #[must_use]
    pub fn n_slots(&self) -> usize {
        if self.n_circles() > 1 { 4 } else { 3 }
    }

    /// Radius of a bounding ball about its centre.
    #[must_use]
    pub fn bound(&self) -> f64 {
        if self.is_wide() {
            hypot(self.radius - self.rounding, self.half) + self.rounding
        } else {
            self.radius
        }
    }

    /// Number of its circles: [`Roller::n_circles`].
    #[must_use]
    pub fn n_circles(&self) -> usize {
        if self.half > 0.0 { 2 } else { 1 }
    }
}

impl Link {
    /// Whether its joint follows another one.
    #[inline(always)]
    pub(super) fn is_coupled(&self) -> bool {
        self.n_rows == 0
    }

    /// `R p` for its joint's origin p.
    #[inline(always)]
    pub(super) fn lever<T: Lane>(&self, R: &Mat3<T>) -> Vec3<T> {
        let one = |column: Vec3<T>, k: usize| column * column.x.like(self.position[k]);
        match self.along {
            Some(0) => one(R.x, 0),
            Some(1) => one(R.y, 1),
            Some(2) => one(R.z, 2),
            _ => R.times_shared(self.position),
        }
    }
}

impl Ratio {
    /// Its coordinate, where the other joint has the coordinate `q`.
    #[inline(always)]
    pub(super) fn of<T: Lane>(&self, q: T) -> T {
        q.like(self.ratio) * q + q.like(self.offset)
    }
}

fn joints_with(model: &Model, has: impl Fn(&JointProperties) -> bool) -> Vec<usize> {
    let joints = model.joints().iter().enumerate();
    joints
        .filter(|(_, joint)| has(joint))
        .map(|(j, _)| j)
        .collect()
}

fn coupled(coordinate: &Coordinate) -> Option<Coupled> {
    coordinate.coupling.map(|coupling| Coupled {
        ratio: Ratio {
            ratio: coupling.ratio,
            offset: coupling.offset,
        },
        combined: coupling.combined,
    })
}

fn check(model: &Model) -> Result<(), Unsupported> {
    if !model.is_free_tree() {
        return Err(Unsupported::NotOneFreeTree);
    }
    let wheels: Vec<WheelDisc> = model.wheels().iter().map(WheelDisc::of).collect();
    let has_lines = wheels.iter().any(|wheel| wheel.n_circles() > 1);
    let n_slots = wheels.iter().map(WheelDisc::n_slots).sum::<usize>();
    let n_slots = n_slots + SIDES * model.limited_joints().len();
    if has_lines && n_slots > MAX_CONTACTS {
        return Err(Unsupported::TooManyContacts(n_slots));
    }
    let n_parts = model.wheels().len() + model.limited_joints().len();
    if n_parts > MOST_PARTS {
        return Err(Unsupported::TooManyParts(n_parts));
    }
    Ok(())
}

fn columns(R: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|j| [0, 1, 2].map(|i| R[(i, j)]))
}

impl Axis {
    fn of(axis: &JointAxis) -> Self {
        match axis {
            JointAxis::X => Self::X,
            JointAxis::Y => Self::Y,
            JointAxis::Z => Self::Z,
            JointAxis::General(u) => Self::General(u.into_inner().into()),
        }
    }
}

impl Symmetry {
    fn of(body: &Body) -> Self {
        let I: &Vector3<f64> = &body.principal_inertia;
        let is_equal = |a: f64, b: f64| (a - b).abs() <= 1e-14 * I.sum();
        if body.principal_axes.is_some() {
            Self::Turned
        } else if is_equal(I.x, I.y) {
            Self::AboutZ
        } else if is_equal(I.x, I.z) {
            Self::AboutY
        } else if is_equal(I.y, I.z) {
            Self::AboutX
        } else {
            Self::None
        }
    }
}
