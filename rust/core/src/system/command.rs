//! Actuator commands of a step: torques, and joints held at set-points.

use serde::{Deserialize, Serialize};

use crate::multibody::{Model, Motor};

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

/// Torques, motors and held joints; every joint can be free, driven, held, or all of these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Torque about each joint's axis (n_joints), N m.
    pub torque: Vec<f64>,
    /// Joints with a drive (n_joints), whose torque adds to `torque`.
    pub drives: Vec<Option<Drive>>,
    /// Which joints are held (n_joints).
    pub held: Vec<Option<HeldJoint>>,
}

impl Command {
    /// No torque, nothing held.
    #[must_use]
    pub fn idle(model: &Model) -> Self {
        Self {
            torque: vec![0.0; model.n_joints()],
            drives: vec![None; model.n_joints()],
            held: vec![None; model.n_joints()],
        }
    }
}
