//! The state of a unit besides its rover: mode, parameters, inputs, results of the last step.

use rover_core::integrator::{StepOptions, StepReport};
use rover_core::nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// States of a unit, as the standard names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum UnitMode {
    Instantiated,
    InitializationMode,
    StepMode,
    Terminated,
}

/// What is fixed once the unit is initialised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    pub friction: f64,
    pub restitution: f64,
    pub gravity: [f64; 3],
    pub time_step: f64,
    /// TOML or JSON; the exported model if empty.
    pub model: String,
}

impl Parameters {
    pub fn of(options: &StepOptions) -> Self {
        Self {
            friction: options.friction_coefficient,
            restitution: options.restitution,
            gravity: options.gravity.into(),
            time_step: options.time_step,
            model: String::new(),
        }
    }

    pub fn options(&self, exported: &StepOptions) -> StepOptions {
        StepOptions {
            friction_coefficient: self.friction,
            restitution: self.restitution,
            gravity: Vector3::from(self.gravity),
            time_step: self.time_step,
            ..exported.clone()
        }
    }
}

/// Inputs as they were set; `None` while the exported command holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// N m, one a wheel.
    pub torques: Option<Vec<f64>>,
    /// rad, one a wheel.
    pub steering: Option<Vec<f64>>,
}

/// Results of the last communication step.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LastStep {
    pub residual: f64,
    pub iterations: f64,
    pub contacts: f64,
    /// Readings of the [inertial unit](crate::inertial).
    pub inertial: Option<[f64; 6]>,
}

impl From<StepReport> for LastStep {
    fn from(report: StepReport) -> Self {
        Self {
            residual: report.residual,
            iterations: report.iterations as f64,
            contacts: report.n_contacts as f64,
            inertial: None,
        }
    }
}
