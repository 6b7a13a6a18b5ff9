//! The machine that all rovers of a block share: its mechanism, its wheels and its boxes.
//!
//! It has a tree or several. Bodies, velocities, motions and joints are
//! numbered as in the model. Lengths are in m.

use std::ops::Deref;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::clusters::Clusters;
use crate::contact::Part;
use crate::contact::placed_wheel::PlacedWheel;
#[cfg(doc)]
use crate::geometry::Roller;
use crate::law::compliance::Tread;
use crate::multibody::description::JointLimits;
use crate::multibody::model::Loop;
use crate::multibody::{Mechanism, Model, Wheel};
use crate::scalar::elementary::hypot;
use crate::solver::batch::pattern::Pattern;
use crate::solver::batch::problem::{MAX_CONTACTS, MAX_DENSE, MAX_DRY};

/// Most slots of a wheel beside those of its circles on a plane.
const MOST_FURTHER: usize = 2;

/// What a block of rovers has in common: a mechanism, and its wheels, boxes and stops.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedMachine {
    mechanism: Arc<Mechanism>,
    /// Wheels, in the model's order.
    pub wheels: Vec<WheelDisc>,
    /// Wheels as sand meets them, in the model's order.
    pub(crate) in_sand: Vec<PlacedWheel>,
    /// Boxes and balls that collide with the ground, in the model's order.
    pub boxes: Vec<BodyBox>,
    /// Joints with stops, ascending.
    pub stops: Vec<Stop>,
    /// Joints with dry friction, ascending.
    pub rubbing: Vec<usize>,
    /// Closed loops.
    pub loops: Vec<Loop>,
    /// Slots between those of the wheels and the joints: [`Self::find_free_slots`].
    pub(crate) spares: Vec<Option<usize>>,
    /// Whether bodies of the machine can touch each other.
    pub(crate) has_pairs: bool,
    /// Whether bodies of one tree can touch each other.
    pub(crate) touches_itself: bool,
    /// Which trees have contact problems of their own.
    pub(crate) clusters: Clusters,
}

impl Deref for SharedMachine {
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
    /// Range of the joint, rad or m.
    pub limits: JointLimits,
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
    pub tread: Option<Tread>,
    /// Sine and cosine of the angle of its rollers from the axle, if it has any.
    pub rollers: Option<[f64; 2]>,
    /// Friction across over that along, if they differ.
    pub across: Option<f64>,
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

impl SharedMachine {
    /// The machine of a model.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        let touches_itself = model.trees().iter().any(|tree| tree.self_contact);
        let mut machine = Self {
            mechanism: Arc::clone(model.mechanism()),
            wheels: model.wheels().iter().map(WheelDisc::of).collect(),
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
            rubbing: model.rubbing_joints().to_vec(),
            loops: model.loops().to_vec(),
            spares: Vec::new(),
            has_pairs: model.trees().len() > 1 || touches_itself,
            touches_itself,
            clusters: Clusters::of(model.mechanism(), model.loops()),
        };
        for cluster in 0..machine.clusters.n() {
            machine.give_slots(cluster);
        }
        machine.spares = machine.find_free_slots();
        machine
    }

    /// What moves of it.
    pub(crate) fn mechanism(&self) -> &Arc<Mechanism> {
        &self.mechanism
    }

    /// Number of contact problems of a rover.
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.clusters.n()
    }

    /// The cluster of a body.
    pub(crate) fn cluster_of(&self, body: usize) -> usize {
        self.clusters.of_tree(self.tree_of_body(body))
    }

    /// Most contacts of a cluster's problem with the whole operator, dry joints among them: none if
    /// a wheel touches a plane at two points.
    pub(crate) fn most_dense(&self, cluster: usize) -> usize {
        let mut wheels = self.wheels_of(cluster);
        let n_dry = self.n_dry(cluster);
        if wheels.any(|wheel| wheel.n_circles() > 1) || n_dry > MAX_DRY {
            0
        } else {
            MAX_DENSE + n_dry
        }
    }

    /// Number of a cluster's joints with dry friction.
    pub(crate) fn n_dry(&self, cluster: usize) -> usize {
        let of = |joint: &&usize| self.cluster_of(self.joints[**joint].body) == cluster;
        self.rubbing.iter().filter(of).count()
    }

    /// Whether wheels of a cluster are rigid, and none touches a plane at two points.
    pub(crate) fn has_rigid_discs(&self, cluster: usize) -> bool {
        let is_rigid = |wheel: &WheelDisc| wheel.tread.is_none();
        let has_lines = |wheel: &WheelDisc| wheel.n_circles() > 1;
        self.wheels_of(cluster).any(is_rigid) && !self.wheels_of(cluster).any(has_lines)
    }

    fn wheels_of(&self, cluster: usize) -> impl Iterator<Item = &WheelDisc> {
        (self.wheels.iter()).filter(move |wheel| self.cluster_of(wheel.body) == cluster)
    }

    /// Gives each wheel of a cluster slots for its circles on a plane, and further ones: as many as
    /// there is room for in a pattern along paths, and all if its pattern has all entries anyway.
    fn give_slots(&mut self, cluster: usize) {
        let is_own = |joint: &usize| self.cluster_of(self.joints[*joint].body) == cluster;
        let n_of_joints = self.joints_with_slots().filter(is_own).count();
        let n_wheels = self.wheels_of(cluster).count();
        let n_circles = self.wheels_of(cluster).map(WheelDisc::n_circles);
        let n_needed = n_of_joints + n_circles.sum::<usize>();
        let further = match MAX_CONTACTS.checked_sub(n_needed) {
            Some(room) => (room / n_wheels.max(1)).min(MOST_FURTHER),
            None => MOST_FURTHER,
        };
        for w in 0..self.wheels.len() {
            if self.cluster_of(self.wheels[w].body) == cluster {
                self.wheels[w].n_slots = self.wheels[w].n_circles() + further;
            }
        }
    }

    /// Whether any wheel yields where it touches.
    #[must_use]
    pub fn yields(&self) -> bool {
        self.wheels.iter().any(|wheel| wheel.tread.is_some())
    }

    /// Pattern of a cluster's contact problems.
    pub(crate) fn pattern(&self, cluster: usize) -> &Arc<Pattern> {
        let bodies = self.slot_bodies();
        let own = bodies.into_iter().flatten();
        let own = own.filter(|body| self.cluster_of(*body) == cluster);
        let paths: Vec<&[usize]> = own.map(|body| self.path(body)).collect();
        self.clusters.pattern(cluster, &paths)
    }

    /// Whether a model differs from this machine only in its inertias, springs, dampers, rotors and
    /// the size of dry friction, so that it can be a lane of a block. A joint that gains or loses a
    /// rotor or dry friction, a mass centre that leaves the frame's origin, or moments that are no
    /// longer equal, make another machine.
    #[must_use]
    pub fn fits(&self, model: &Model) -> bool {
        Self::of(model) == *self
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
            tread: wheel.tread,
            rollers: wheel.rollers,
            across: wheel.across,
            n_slots: 0,
        }
    }

    /// Whether the wheel has a width.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.half > 0.0 || self.rounding > 0.0
    }

    /// Whether the wheel may touch with the two ends of a rigid tread.
    #[must_use]
    pub fn has_rigid_ends(&self) -> bool {
        self.half > 0.0 && self.tread.is_none()
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
