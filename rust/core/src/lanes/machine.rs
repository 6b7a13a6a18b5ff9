//! The machine that all rovers of a block share: its tree, its wheels and its boxes.
//!
//! Body 0 is the trunk, on the free base; body `b ≥ 1` turns about one axis, with joint `b − 1` and
//! velocity `b + 5`. Lengths are in m.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::pattern::Pattern;
use super::problem::MAX_CONTACTS;
#[cfg(doc)]
use crate::geometry::Roller;
use crate::law::compliance::Compliance;
use crate::multibody::joint::{Joint, JointAxis};
use crate::multibody::model::BASE;

use crate::multibody::{Body, Model, Wheel};
use crate::scalar::elementary::hypot;
use crate::scalar::{Lane, Mat3, Vec3};

/// Why a machine has no ordinary step.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum NotOrdinary {
    /// It has several trees, or its root is fixed.
    #[error("the machine is not one tree on a free base")]
    NotOneFreeTree,
    /// A joint is not a revolute joint of its own.
    #[error("the joint of '{body}' is not a revolute joint with a coordinate of its own")]
    NotRevolute {
        /// Name of the body.
        body: String,
    },
    /// A joint has a spring, a damper or a rotor.
    #[error("the joint of '{body}' has a spring, a damper or a rotor")]
    PassiveJoint {
        /// Name of the body.
        body: String,
    },
    /// A joint has stops.
    #[error("the joint of '{body}' has stops")]
    LimitedJoint {
        /// Name of the body.
        body: String,
    },
    /// Its wheels can have more contacts than a problem.
    #[error("{n_wheels} wheels with a width can have more than {MAX_CONTACTS} contacts")]
    TooManyWheels {
        /// Their number.
        n_wheels: usize,
    },
    /// It has balls that collide.
    #[error("the machine has balls that collide")]
    Balls,
    /// Its bodies can touch each other.
    #[error("bodies of the machine can touch each other")]
    SelfContact,
}

/// What a block of rovers has in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// The bodies, carriers before what they carry; the first is the trunk.
    pub links: Vec<Link>,
    /// Wheels, in the model's order.
    pub wheels: Vec<WheelDisc>,
    /// Boxes that collide with the ground, in the model's order.
    pub boxes: Vec<BodyBox>,
    /// Largest distance of a joint from the trunk's origin.
    pub reach: f64,
    entries: Vec<usize>,
    turning: Vec<usize>,
    paths: Vec<usize>,
    /// Pattern of its contact problems, if they are solved by the factors of their operator.
    pub(super) pattern: Option<Arc<Pattern>>,
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
    /// Axis of the joint, the same in the joint's frame and the body's.
    pub axis: Axis,
    /// Whether a step need not turn it: [`Body::is_spinner`].
    pub is_spinner: bool,
    /// Whether it carries no other body.
    pub is_leaf: bool,
    /// Whether its carrier carries no body with a higher index.
    pub is_last: bool,
    /// Whether its mass centre is its frame's origin.
    pub is_centred: bool,
    /// What is known of its principal axes.
    pub symmetry: Symmetry,
    /// Its row in [`Machine::entries`].
    row: Range<usize>,
    path: Range<usize>,
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

/// A box that collides with the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyBox {
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
    /// What makes its step not ordinary.
    pub fn of(model: &Model) -> Result<Self, NotOrdinary> {
        check(model)?;
        let bodies = model.bodies();
        let mut machine = Self {
            links: Vec::with_capacity(bodies.len()),
            wheels: (model.wheels().iter()).map(WheelDisc::of).collect(),
            boxes: (model.boxes().iter())
                .map(|part| BodyBox {
                    body: part.body,
                    centre: part.centre.into(),
                    rotation: columns(&part.rotation),
                    half_size: part.half_size.into(),
                })
                .collect(),
            reach: model.trees()[0].reach,
            entries: Vec::new(),
            turning: (0..bodies.len() - 1)
                .filter(|&joint| !bodies[joint + 1].is_spinner)
                .collect(),
            paths: Vec::new(),
            pattern: None,
        };
        for (b, body) in bodies.iter().enumerate() {
            machine.add(b, body, bodies);
        }
        if machine.has_lines() {
            let paths = (machine.wheels.iter())
                .flat_map(|wheel| {
                    let path = machine.path(wheel.body).to_vec();
                    std::iter::repeat_n(path, wheel.n_slots())
                })
                .collect();
            machine.pattern = Some(Arc::new(Pattern::new(machine.nv(), paths)));
        }
        Ok(machine)
    }

    /// Whether a wheel has a width.
    #[must_use]
    pub fn has_wide_wheels(&self) -> bool {
        self.wheels.iter().any(WheelDisc::is_wide)
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

    /// The machine itself, or an equal one that is in use: equal machines are one, so that rovers
    /// which can share a block know each other by it.
    #[must_use]
    pub fn shared(self) -> Arc<Self> {
        static IN_USE: Mutex<Vec<Weak<Machine>>> = Mutex::new(Vec::new());
        let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
        in_use.retain(|machine| machine.strong_count() > 0);
        let equal = (in_use.iter().filter_map(Weak::upgrade)).find(|machine| **machine == self);
        equal.unwrap_or_else(|| {
            let own = Arc::new(self);
            in_use.push(Arc::downgrade(&own));
            own
        })
    }

    fn add(&mut self, b: usize, body: &Body, bodies: &[Body]) {
        let (first, path) = (self.entries.len(), self.paths.len());
        let mut mover = Some(b).filter(|&b| b > 0);
        while let Some(body) = mover {
            self.entries.insert(first, body);
            mover = bodies[body].parent.filter(|&parent| parent > 0);
        }
        self.paths.extend(0..BASE);
        (self.paths).extend(self.entries[first..].iter().map(|&body| velocity(body)));
        let mut others = bodies[b + 1..].iter();
        self.links.push(Link {
            parent: body.parent.unwrap_or(0),
            position: body.position.into(),
            along: (0..3).find(|&k| (0..3).all(|i| i == k || body.position[i] == 0.0)),
            rotation: body.rotation.as_ref().map(columns),
            axis: Axis::of(body),
            is_spinner: body.is_spinner,
            is_leaf: !others.clone().any(|other| other.parent == Some(b)),
            is_last: !others.any(|other| other.parent == body.parent),
            is_centred: body.is_centred(),
            symmetry: Symmetry::of(body),
            row: first..self.entries.len(),
            path: path..self.paths.len(),
        });
    }

    /// Whether a model differs from this machine in its inertias alone, so that it can be a lane of
    /// a block. A mass centre that leaves the frame's origin, or moments that are no longer equal,
    /// make another machine.
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

    /// Number of joints.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.links.len() - 1
    }

    /// Number of velocities.
    #[inline]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.links.len() - 1 + BASE
    }

    /// Bodies between the trunk and body `b`, from the trunk outwards, without either.
    #[must_use]
    pub fn ancestors(&self, b: usize) -> &[usize] {
        (self.row(b).split_last()).map_or(&[], |(_, ancestors)| ancestors)
    }

    /// The row of body `b` in [`Self::entries`]; empty for the trunk.
    #[inline(always)]
    pub(super) fn row(&self, b: usize) -> &[usize] {
        &self.entries[self.links[b].row.clone()]
    }

    /// Velocities that move body `b`: those of the base, then of its ancestors, then its own.
    #[inline(always)]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        &self.paths[self.links[b].path.clone()]
    }

    /// The bodies between the trunk and each body, from the trunk outwards, and the body itself:
    /// the columns of each joint's row in the mass matrix, row after row.
    #[inline(always)]
    pub(super) fn entries(&self) -> &[usize] {
        &self.entries
    }

    /// Joints that a step turns: all but those of the spinners.
    #[inline(always)]
    pub(super) fn turning(&self) -> &[usize] {
        &self.turning
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
        2 * self.n_circles()
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

    /// Where its row in [`Machine::entries`] begins.
    #[inline(always)]
    pub(super) fn row(&self) -> usize {
        self.row.start
    }

    /// Where its own entry is.
    #[inline(always)]
    pub(super) fn diagonal(&self) -> usize {
        self.row.end - 1
    }
}

/// Velocity of a body's joint.
#[inline(always)]
#[must_use]
pub fn velocity(body: usize) -> usize {
    body + (BASE - 1)
}

fn check(model: &Model) -> Result<(), NotOrdinary> {
    let bodies = model.bodies();
    if !model.is_free_tree() {
        return Err(NotOrdinary::NotOneFreeTree);
    }
    if !model.only_turns() {
        let is_turn = |body: &Body| matches!(&body.joint, Joint::Revolute(joint) if joint.coordinate.coupling.is_none());
        let other = bodies[1..].iter().find(|body| !is_turn(body));
        return Err(NotOrdinary::NotRevolute {
            body: other.unwrap_or(&bodies[0]).name.clone(),
        });
    }
    for joint in model.joints() {
        let body = || bodies[joint.body].name.clone();
        if joint.is_passive || joint.passive.armature > 0.0 {
            return Err(NotOrdinary::PassiveJoint { body: body() });
        }
        if joint.limits.is_some() {
            return Err(NotOrdinary::LimitedJoint { body: body() });
        }
    }
    let wheels: Vec<WheelDisc> = model.wheels().iter().map(WheelDisc::of).collect();
    let has_lines = wheels.iter().any(|wheel| wheel.n_circles() > 1);
    if has_lines && wheels.iter().map(WheelDisc::n_slots).sum::<usize>() > MAX_CONTACTS {
        return Err(NotOrdinary::TooManyWheels {
            n_wheels: wheels.len(),
        });
    }
    if !model.spheres().is_empty() {
        return Err(NotOrdinary::Balls);
    }
    if model.description().self_contact {
        return Err(NotOrdinary::SelfContact);
    }
    let joints = (1..bodies.len()).zip(model.joints());
    for (b, joint) in joints {
        assert!(
            joint.body == b && joint.velocity == velocity(b),
            "invariant: velocities in the order of the bodies"
        );
    }
    Ok(())
}

fn columns(R: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|j| [0, 1, 2].map(|i| R[(i, j)]))
}

impl Axis {
    fn of(body: &Body) -> Self {
        match body.joint.axis() {
            None | Some(JointAxis::X) => Self::X,
            Some(JointAxis::Y) => Self::Y,
            Some(JointAxis::Z) => Self::Z,
            Some(JointAxis::General(u)) => Self::General(u.into_inner().into()),
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
