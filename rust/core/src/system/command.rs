//! Commands of a step: torques, joints held at set-points, and wrenches from outside.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::multibody::{Kinematics, Model, Motor};

/// A joint held at a set-point by a PD controller that is implicit in the step:
/// `τ = −stiffness (q − set_point) − damping q̇`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldJoint {
    /// rad.
    pub set_point: f64,
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
}

/// A driven joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// Commanded torque about the joint's axis, N m.
    pub torque: f64,
    /// Torque–speed line; without one the torque is the command at any speed.
    pub motor: Option<Motor>,
}

/// A force and a moment from outside on a body, constant in world axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Index of the frame of a solid, [`Model::frames`].
    pub solid: usize,
    /// Where the force acts, in the solid's frame, m.
    pub point: [f64; 3],
    /// N.
    pub force: [f64; 3],
    /// N m.
    pub moment: [f64; 3],
}

impl Wrench {
    /// Whether it fits a model, and all of its numbers are finite.
    #[must_use]
    pub fn is_of(&self, model: &Model) -> bool {
        let numbers = [self.point, self.force, self.moment];
        self.solid < model.frames().len() && numbers.as_flattened().iter().all(|x| x.is_finite())
    }

    /// Adds its generalized force (nv), N and N m, at the poses of `kinematics` for a step.
    pub(super) fn add_force(&self, model: &Model, kinematics: &Kinematics, out: &mut [f64]) {
        let frame = &model.frames()[self.solid];
        let (force, body) = (Vector3::from(self.force), frame.body);
        let point = frame.position + frame.rotation * Vector3::from(self.point);
        let x = kinematics.r(body) + kinematics.spun(model, body) * point;
        let moment = x.cross(&force) + Vector3::from(self.moment);
        let lead = model.path(body)[..model.lead(body)].iter();
        for (&k, value) in lead.zip(force.iter().chain(&moment)) {
            out[k] += value;
        }
        for mover in model.movers(body) {
            out[mover.velocity] += kinematics.power(mover.motion, &force, &moment);
        }
    }
}

/// Torques, motors and held joints; every joint can be free, driven, held, or all of these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Torque about each joint's axis (n_joints), N m.
    pub torque: Vec<f64>,
    /// Joints with a drive (n_joints), whose torque adds to `torque`.
    pub drives: Vec<Option<Drive>>,
    /// Which joints are held (n_joints).
    pub held: Vec<Option<HeldJoint>>,
    /// From outside, at most one a solid.
    pub wrenches: Vec<Wrench>,
}

impl Command {
    /// No torque, nothing held.
    #[must_use]
    pub fn idle(model: &Model) -> Self {
        Self {
            torque: vec![0.0; model.n_joints()],
            drives: vec![None; model.n_joints()],
            held: vec![None; model.n_joints()],
            wrenches: Vec::new(),
        }
    }
}
