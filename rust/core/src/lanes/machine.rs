//! The machine that all rovers of a block share: its mechanism, its wheels and its boxes.
//!
//! Body 0 is the trunk, on the free base. Bodies, velocities, motions and joints are numbered as in
//! the model. Lengths are in m.

use std::ops::Deref;
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
use crate::multibody::{Mechanism, Model, Wheel};
use crate::scalar::elementary::hypot;
use crate::system::sand_wheel::PlacedWheel;

/// Most wheels and joints with stops: the operator of a block has room for contacts of all of them.
pub const MOST_PARTS: usize = 32;

/// Why a machine has no fast step.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Unsupported {
    /// It has several trees, or its root is fixed.
    #[error("the machine is not one tree on a free base")]
    NotOneFreeTree,
    /// Loops are closed.
    #[error("the machine has closed loops")]
    ClosedLoops,
    /// Joints have dry friction.
    #[error("joints of the machine have dry friction")]
    JointFriction,
    /// Its wheels and stops can have more contacts than a problem.
    #[error("wheels with a width and stops can have {0} contacts, more than {MAX_CONTACTS}")]
    TooManyContacts(usize),
    /// It has more wheels and joints with stops than lanes have room for.
    #[error("the machine has {0} wheels and joints with stops, more than {MOST_PARTS}")]
    TooManyParts(usize),
}

/// What a block of rovers has in common: a mechanism, and its wheels, boxes and stops.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    mechanism: Mechanism,
    /// Wheels, in the model's order.
    pub wheels: Vec<WheelDisc>,
    /// The same as sand meets them.
    pub(super) in_sand: Vec<PlacedWheel>,
    /// Boxes and balls that collide with the ground, in the model's order.
    pub boxes: Vec<BodyBox>,
    /// Joints with stops, ascending.
    pub stops: Vec<Stop>,
    /// Slots between those of the wheels and the stops: [`Self::find_free_slots`].
    pub(super) spares: Vec<Option<usize>>,
    /// Whether its bodies can touch each other.
    pub(super) has_pairs: bool,
    /// Pattern of its contact problems; none if they cannot be solved by the factors of their
    /// operator.
    pub(super) pattern: Option<Arc<Pattern>>,
}

impl Deref for Machine {
    type Target = Mechanism;

    #[inline(always)]
    fn deref(&self) -> &Mechanism {
        &self.mechanism
    }
}

/// A joint with stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Index of the joint.
    pub joint: usize,
    /// Its range, rad or m.
    pub limits: Limits,
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
    /// Sine and cosine of the angle of its rollers from the axle, if it has any.
    pub rollers: Option<[f64; 2]>,
}

/// A box that collides with the ground, or around a ball or another collider which does.
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
        let mut machine = Self {
            mechanism: model.mechanism().clone(),
            wheels: (model.wheels().iter()).map(WheelDisc::of).collect(),
            in_sand: (model.wheels().iter()).map(PlacedWheel::of).collect(),
            boxes: (Part::all(model).skip(model.wheels().len()))
                .map(|part| BodyBox::of(model, part))
                .collect(),
            stops: (model.limited_joints().iter())
                .filter_map(|&joint| {
                    let limits = model.joints()[joint].limits?;
                    Some(Stop { joint, limits })
                })
                .collect(),
            spares: Vec::new(),
            has_pairs: model.trees()[0].self_contact,
            pattern: None,
        };
        machine.spares = machine.find_free_slots(machine.has_pairs);
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

    /// Whether a model differs from this machine only in its inertias, springs, dampers and rotors,
    /// so that it can be a lane of a block. A joint that gains or loses a rotor, a mass centre that
    /// leaves the frame's origin, or moments that are no longer equal, make another machine.
    #[must_use]
    pub fn fits(&self, model: &Model) -> bool {
        Self::of(model).is_ok_and(|other| other == *self)
    }
}

impl BodyBox {
    fn of(model: &Model, part: Part) -> Self {
        let (rotation, half_size) = match part {
            Part::Box(i) => (model.boxes()[i].rotation, model.boxes()[i].half_size),
            Part::Collider(i) => {
                let solid = &model.colliders()[i];
                let (middle, half_size) = solid.bounding_box();
                // About the centre, on which the poses of the part are based.
                (solid.rotation, half_size + middle.abs())
            }
            _ => (Matrix3::identity(), Vector3::repeat(part.bound(model))),
        };
        Self {
            part,
            body: part.body(model),
            centre: part.centre(model).into(),
            rotation: rotation.into(),
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
            rollers: wheel.rollers,
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

fn check(model: &Model) -> Result<(), Unsupported> {
    if !model.is_free_tree() {
        return Err(Unsupported::NotOneFreeTree);
    }
    if !model.loops().is_empty() {
        return Err(Unsupported::ClosedLoops);
    }
    if !model.rubbing_joints().is_empty() {
        return Err(Unsupported::JointFriction);
    }
    let wheels: Vec<WheelDisc> = model.wheels().iter().map(WheelDisc::of).collect();
    let has_lines = wheels.iter().any(|wheel| wheel.n_circles() > 1);
    let n_slots = wheels.iter().map(WheelDisc::n_slots).sum::<usize>();
    let n_slots = n_slots + model.limited_joints().len();
    if has_lines && n_slots > MAX_CONTACTS {
        return Err(Unsupported::TooManyContacts(n_slots));
    }
    let n_parts = model.wheels().len() + model.limited_joints().len();
    if n_parts > MOST_PARTS {
        return Err(Unsupported::TooManyParts(n_parts));
    }
    Ok(())
}
