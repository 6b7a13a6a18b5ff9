//! The machine that all rovers of a block share: its mechanism, its wheels and its boxes.
//!
//! Body 0 is the trunk, on the free base. Bodies, velocities, motions and joints are numbered as in
//! the model. Lengths are in m.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::pattern::Pattern;
use super::problem::MAX_CONTACTS;
use crate::contact::Part;
#[cfg(doc)]
use crate::geometry::Roller;
use crate::law::compliance::Compliance;
use crate::multibody::description::Limits;
use crate::multibody::model::Loop;
use crate::multibody::{Mechanism, Model, Wheel};
use crate::scalar::elementary::hypot;
use crate::system::sand_wheel::PlacedWheel;

/// Most slots of a wheel beside those of its circles on a plane.
const MOST_FURTHER: usize = 2;

/// Why a machine has no fast step.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Unsupported {
    /// It has several trees, or its root is fixed.
    #[error("the machine is not one tree on a free base")]
    NotOneFreeTree,
    /// A problem has no room for the contacts of its wheels with a plane, its stops and its joints
    /// with dry friction.
    #[error("wheels, stops and dry joints can have {0} contacts, more than {MAX_CONTACTS}")]
    TooManyContacts(usize),
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
    /// Joints with dry friction, ascending.
    pub rubbing: Vec<usize>,
    /// Closed loops, and whether one of them ties the machine to the world.
    pub loops: Vec<Loop>,
    pub(super) holds_the_world: bool,
    /// Slots between those of the wheels and the joints: [`Self::find_free_slots`].
    pub(super) spares: Vec<Option<usize>>,
    /// Whether its bodies can touch each other.
    pub(super) has_pairs: bool,
    pattern: LazyPattern,
}

/// The pattern of a machine's contact problems, found where it is first needed. It follows from the
/// rest of the machine.
#[derive(Clone, Debug, Default)]
struct LazyPattern(OnceLock<Arc<Pattern>>);

impl PartialEq for LazyPattern {
    fn eq(&self, _: &Self) -> bool {
        true
    }
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
    /// Number of its slots for contacts.
    pub n_slots: usize,
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
        let mut wheels: Vec<WheelDisc> = model.wheels().iter().map(WheelDisc::of).collect();
        let rubbing = model.rubbing_joints().to_vec();
        give_slots(&mut wheels, model.limited_joints().len() + rubbing.len())?;
        let mut machine = Self {
            mechanism: model.mechanism().clone(),
            wheels,
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
            rubbing,
            loops: model.loops().to_vec(),
            holds_the_world: model.holds_the_world(),
            spares: Vec::new(),
            has_pairs: model.trees()[0].self_contact,
            pattern: LazyPattern::default(),
        };
        machine.spares = machine.find_free_slots(machine.has_pairs);
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

    /// Pattern of its contact problems.
    pub(super) fn pattern(&self) -> &Arc<Pattern> {
        self.pattern.0.get_or_init(|| self.find_pattern())
    }

    /// Whether a model differs from this machine only in its inertias, springs, dampers, rotors and
    /// the size of dry friction, so that it can be a lane of a block. A joint that gains or loses a
    /// rotor or dry friction, a mass centre that leaves the frame's origin, or moments that are no
    /// longer equal, make another machine.
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
            n_slots: 0,
        }
    }

    /// Whether it has a width.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.half > 0.0 || self.rounding > 0.0
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
    Ok(())
}

/// Gives each wheel slots for its circles on a plane, and as many further ones as there is room
/// for. `n_of_joints`: number of slots of joints.
fn give_slots(wheels: &mut [WheelDisc], n_of_joints: usize) -> Result<(), Unsupported> {
    let n_needed = n_of_joints + wheels.iter().map(WheelDisc::n_circles).sum::<usize>();
    let Some(room) = MAX_CONTACTS.checked_sub(n_needed) else {
        return Err(Unsupported::TooManyContacts(n_needed));
    };
    let further = (room / wheels.len().max(1)).min(MOST_FURTHER);
    for wheel in wheels {
        wheel.n_slots = wheel.n_circles() + further;
    }
    Ok(())
}
