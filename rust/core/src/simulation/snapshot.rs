//! All that a simulation needs to continue bit for bit.

use serde::{Deserialize, Serialize};

use crate::integrator::WarmStart;
use crate::multibody::State;
use crate::system::{ActiveContact, Command};

/// State, commands, the solver's starting point and the last step's contacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// [`crate::multibody::Model::fingerprint`] of the machine.
    pub model: u64,
    /// Where and how fast.
    pub state: State,
    /// Torques and held joints.
    pub command: Command,
    /// Driving torque of each wheel, positive forward, N m.
    pub wheel_torque: Vec<f64>,
    /// Torque about each joint's axis that comes on top, N m.
    pub joint_torque: Vec<f64>,
    /// Mean torque of each wheel's drive in the last step, positive forward, N m.
    pub motor_torque: Vec<f64>,
    /// Where the next solve starts.
    pub warm_start: WarmStart,
    /// Contacts of the last step.
    pub active: Vec<ActiveContact>,
}
