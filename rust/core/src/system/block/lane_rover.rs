//! A rover that takes a lane of a block: what the block reads of it, and writes back.

use std::sync::Arc;

use crate::geometry::Terrain;
use crate::integrator::{StepOptions, WarmStart};
use crate::multibody::{Configuration, Model};
use crate::sand::SandState;
use crate::system::Command;

/// A rover by its parts.
pub struct LaneRover<'a> {
    /// Model of the rover, whose machine is the block's.
    pub model: &'a Arc<Model>,
    /// Ground under the rover.
    pub terrain: &'a Arc<dyn Terrain>,
    /// Options of the step; those of all rovers of a block are alike but for gravity and friction.
    pub options: &'a StepOptions,
    /// Command to the rover: torques, motors and held joints.
    pub command: &'a Command,
    /// Configuration.
    pub configuration: &'a mut Configuration,
    /// Velocity (nv).
    pub v: &'a mut [f64],
    /// s.
    pub time: &'a mut f64,
    /// Impulses of the last step.
    pub warm_start: &'a mut WarmStart,
    /// Work of each joint's drive since the call began (n_joints), J.
    pub drive_work: &'a mut [f64],
    /// Mean torque of each wheel's drive in the last step, positive forward, N m.
    pub wheel_torque: &'a mut [f64],
    /// Impulses of the rows of its loops in the last step (n_loop_rows), N s and N m s.
    pub loop_impulses: &'a mut [f64],
    /// The sand under its wheels, if its ground is soft. The block keeps its ruts until the rover
    /// is stored.
    pub sand: Option<&'a mut SandState>,
}
