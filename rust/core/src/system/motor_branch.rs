//! A motor in a step: the active branch of its torque–speed line, implicit in the rate.
//!
//! ```text
//! τ = at_rest − slope (ω + θ_j Δω),    M̂ = M + h θ_j slope,    θ_j of the page `fitted_theta`
//! ```
//!
//! The branch is chosen at the θ_j-weighted rate, so that torque, branch and work are consistent.
//! If another branch holds at the end of the step, the step is repeated
//! ([`crate::integrator::MechanicalSystem::revise`]). Torques never rise with the speed, so the
//! implicit term is dissipative.

use super::command::Drive;
use super::fitted_theta::fitted_theta;
use crate::multibody::{DriveTrial, Motor, MotorRegime};

/// Branch and θ_j of a coordinate that a motor may turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotorBranch {
    trial: DriveTrial,
    theta: f64,
}

impl Default for MotorBranch {
    fn default() -> Self {
        Self {
            trial: DriveTrial::default(),
            theta: 0.5,
        }
    }
}

impl MotorBranch {
    /// θ_j in [½, 1].
    #[inline]
    pub(crate) fn theta(&self) -> f64 {
        self.theta
    }

    /// Damping of the branch, N m s/rad.
    #[inline]
    pub(crate) fn damping(&self) -> f64 {
        match self.trial.regime() {
            MotorRegime::Constant(_) => 0.0,
            MotorRegime::Line { slope, .. } => slope,
        }
    }

    /// Chooses θ_j for a coordinate with this total damping (N m s/rad), stiffness (N m/rad) and
    /// inertia (kg m²).
    ///
    /// The line's slope counts on every branch: if θ_j changed with the branch, no branch might be
    /// consistent.
    #[inline]
    pub(crate) fn set_theta(
        &mut self,
        (h, theta): (f64, f64),
        (damping, stiffness): (f64, f64),
        inertia: f64,
    ) {
        self.theta = if damping > 0.0 || stiffness > 0.0 {
            let z = h * (damping + 0.5 * h * stiffness) / inertia;
            fitted_theta(z).max(theta)
        } else {
            theta
        };
    }

    /// Rate (rad/s) at which a step between two rates evaluates implicit terms.
    #[inline]
    pub(crate) fn rate(&self, begin: f64, end: f64) -> f64 {
        begin + self.theta * (end - begin)
    }

    /// Chooses the branch for a step that begins at a rate, rad/s.
    #[inline]
    pub(crate) fn choose(&mut self, drive: Option<&Drive>, rate: f64) {
        let (command, motor) = parts(drive);
        self.trial = DriveTrial::at(motor, command, rate);
    }

    /// Moves towards the branch of a step between two rates, rad/s; true if the branch changed.
    #[inline]
    pub(crate) fn revise(&mut self, drive: Option<&Drive>, begin: f64, end: f64) -> bool {
        let (command, Some(motor)) = parts(drive) else {
            return false; // Without a line there is one branch.
        };
        let rate = self.rate(begin, end);
        self.trial.revise(Some(motor), command, rate)
    }

    /// Mean torque of a step between two rates (rad/s), N m.
    #[inline]
    pub(crate) fn torque(&self, begin: f64, end: f64) -> f64 {
        self.trial.regime().torque(self.rate(begin, end))
    }

    /// Work (J) that the motor is credited with in a step between two rates
    /// (rad/s) that turns it by `turned` (rad).
    ///
    /// A torque–speed line only reduces the power of the command, `(τ − command) ω ≤ 0`. In a step
    /// that reverses the rate, the implicit torque and the mean rate may violate this; the surplus
    /// is not counted as work.
    #[inline]
    pub(crate) fn work(&self, drive: Option<&Drive>, begin: f64, end: f64, turned: f64) -> f64 {
        let work = self.torque(begin, end) * turned;
        match drive {
            Some(Drive {
                torque,
                motor: Some(motor),
            }) => work.min(motor.limited(*torque) * turned),
            _ => work,
        }
    }
}

/// Command (N m) and line of a drive; nothing where there is none.
#[inline]
fn parts(drive: Option<&Drive>) -> (f64, Option<&Motor>) {
    drive.map_or((0.0, None), |drive| (drive.torque, drive.motor.as_ref()))
}

/// Slope of a drive's line, N m s/rad; 0 without one.
#[inline]
pub(crate) fn line_slope(drive: Option<&Drive>) -> f64 {
    let (_, motor) = parts(drive);
    motor.map_or(0.0, Motor::slope)
}
