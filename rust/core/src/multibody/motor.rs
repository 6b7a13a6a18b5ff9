//! Torque–speed line of a wheel motor.
//!
//! ```text
//! τ = command, within ± stall (1 ∓ ω/ω₀) and ± stall
//! ```
//!
//! Below the line the torque is the command. On the line it falls linearly with the speed and
//! reaches zero at the no-load speed ω₀, where the back-EMF equals the supply voltage. Driven
//! beyond ω₀, a regenerating motor brakes along the line, at most with the stall torque; any other
//! motor spins freely and brakes on command only. With an infinite ω₀ the torque is the command
//! within ± stall at any speed.
//!
//! Source: the permanent-magnet DC motor at its supply voltage, e.g. Siciliano et al. 2009,
//! *Robotics*, ch. 5.

use serde::{Deserialize, Deserializer, Serialize};

use super::error::ModelError;

/// A torque–speed line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// Torque of the line at rest, N m.
    pub stall_torque: f64,
    /// ω₀, the zero of the line, rad/s; may be infinite (null in JSON, which has no infinity).
    #[serde(deserialize_with = "speed")]
    pub no_load_speed: f64,
    /// Whether it brakes when driven faster than ω₀.
    #[serde(default = "regenerates")]
    pub regenerating: bool,
}

fn regenerates() -> bool {
    true
}

fn speed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    if deserializer.is_human_readable() {
        let written = Option::<f64>::deserialize(deserializer)?;
        return Ok(written.unwrap_or(f64::INFINITY));
    }
    f64::deserialize(deserializer)
}

/// Range of torques, N m.
const TORQUES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// Range of finite no-load speeds, rad/s.
const SPEEDS: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// Local dependence of the torque on the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotorRegime {
    /// Constant, N m.
    Constant(f64),
    /// `τ = at_rest − slope ω`, N m and N m s/rad.
    Line {
        /// N m.
        at_rest: f64,
        /// N m s/rad.
        slope: f64,
    },
}

impl Motor {
    /// Checks the ranges; `at` makes a field's full name.
    ///
    /// # Errors
    /// The first number out of its range.
    pub fn check(&self, at: impl Fn(&str) -> String) -> Result<(), ModelError> {
        if !TORQUES.contains(&self.stall_torque) {
            return Err(ModelError::OutOfRange {
                field: at("stall_torque"),
                range: "from 1e-9 to 1e9 N m",
                value: self.stall_torque,
            });
        }
        let speed = self.no_load_speed;
        if !(SPEEDS.contains(&speed) || speed.is_infinite() && speed > 0.0) {
            return Err(ModelError::OutOfRange {
                field: at("no_load_speed"),
                range: "from 1e-6 to 1e9 rad/s, or infinite",
                value: speed,
            });
        }
        Ok(())
    }

    /// Slope of the line, N m s/rad.
    #[must_use]
    pub fn slope(&self) -> f64 {
        self.stall_torque / self.no_load_speed
    }

    /// The command (N m), limited to the stall torque.
    #[inline]
    #[must_use]
    pub fn limited(&self, command: f64) -> f64 {
        command.clamp(-self.stall_torque, self.stall_torque)
    }

    /// Number of the branch that holds for a command (N m) at a rate (rad/s), both about the
    /// joint's axis; they are in the order of the rate.
    #[inline]
    fn branch(&self, command: f64, rate: f64) -> usize {
        let command = self.limited(command);
        let drop = self.slope() * rate;
        let (upper, lower) = (self.stall_torque - drop, -self.stall_torque - drop);
        match () {
            () if command > upper && upper < -self.end(-command) => 4,
            () if command > upper => 3,
            () if command < lower && lower > self.end(command) => 0,
            () if command < lower => 1,
            () => 2,
        }
    }

    /// How far the line is followed beyond the no-load speed, N m.
    fn end(&self, towards: f64) -> f64 {
        if self.regenerating {
            self.stall_torque
        } else {
            towards.max(0.0)
        }
    }

    /// The torque of a branch.
    #[inline]
    fn on_branch(&self, branch: usize, command: f64) -> MotorRegime {
        let command = self.limited(command);
        let line = |at_rest| MotorRegime::Line {
            at_rest,
            slope: self.slope(),
        };
        match branch {
            0 => MotorRegime::Constant(self.end(command)),
            1 => line(-self.stall_torque),
            2 => MotorRegime::Constant(command),
            3 => line(self.stall_torque),
            _ => MotorRegime::Constant(-self.end(-command)),
        }
    }

    /// Torque for a command (N m) at a rate (rad/s), N m.
    #[must_use]
    pub fn torque(&self, command: f64, rate: f64) -> f64 {
        self.on_branch(self.branch(command, rate), command)
            .torque(rate)
    }
}

/// The trial branch of a drive's torque in a step.
///
/// A step with one branch yields the rate at its end, and thus the side of the branch on which the
/// motor works. For a single wheel, moving one branch at a time terminates after at most four
/// steps, since the torque falls with the rate. Jumping directly to the branch of that rate may
/// alternate forever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveTrial {
    branch: usize,
    regime: MotorRegime,
}

impl Default for DriveTrial {
    fn default() -> Self {
        Self {
            branch: 2,
            regime: MotorRegime::Constant(0.0),
        }
    }
}

impl DriveTrial {
    /// The branch that holds for a command (N m) at a rate (rad/s); without a motor the torque is
    /// the command.
    #[inline]
    #[must_use]
    pub fn at(motor: Option<&Motor>, command: f64, rate: f64) -> Self {
        let branch = motor.map_or(2, |motor| motor.branch(command, rate));
        Self::on(motor, command, branch)
    }

    #[inline]
    fn on(motor: Option<&Motor>, command: f64, branch: usize) -> Self {
        let constant = MotorRegime::Constant(command);
        let regime = motor.map_or(constant, |motor| motor.on_branch(branch, command));
        Self { branch, regime }
    }

    /// Moves one branch towards that of a rate (rad/s); true if the torque changed.
    #[inline]
    pub fn revise(&mut self, motor: Option<&Motor>, command: f64, rate: f64) -> bool {
        let wanted = motor.map_or(2, |motor| motor.branch(command, rate));
        let branch = wanted.clamp(self.branch.saturating_sub(1), self.branch + 1);
        let revised = Self::on(motor, command, branch);
        let is_new = revised.regime != self.regime;
        *self = revised;
        is_new
    }

    /// The torque.
    #[inline]
    #[must_use]
    pub fn regime(&self) -> MotorRegime {
        self.regime
    }
}

impl MotorRegime {
    /// Torque at a rate (rad/s), N m.
    #[inline]
    #[must_use]
    pub fn torque(&self, rate: f64) -> f64 {
        match *self {
            Self::Constant(torque) => torque,
            Self::Line { at_rest, slope } => at_rest - slope * rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_torque_follows_the_command_up_to_the_line_and_brakes_beyond_it() {
        let mut motor = Motor {
            stall_torque: 300.0,
            no_load_speed: 30.0,
            regenerating: true,
        };
        let expected = [
            (150.0, 10.0, 150.0),   // below the line
            (150.0, 20.0, 100.0),   // on it
            (150.0, 33.0, -30.0),   // driven faster than it can go
            (0.0, 29.0, 0.0),       // coasting
            (0.0, 33.0, -30.0),     // regenerating
            (-150.0, 20.0, -150.0), // braking
            (150.0, 1e6, -300.0),   // never beyond the stall torque
            (400.0, -3.0, 300.0),
            (-150.0, -20.0, -100.0),
            (0.0, -33.0, 30.0),
            (350.0, -1.0, 300.0), // it has no more, also turning backward
            (-350.0, 1.0, -300.0),
        ];
        for (command, rate, torque) in expected {
            let given = motor.torque(command, rate);
            assert!((given - torque).abs() < 1e-12, "{command} {rate}: {given}");
        }
        motor.regenerating = false;
        assert!(motor.torque(150.0, 33.0).abs() < 1e-12);
        assert!(motor.torque(0.0, 33.0).abs() < 1e-12);
        assert!((motor.torque(-150.0, 33.0) + 150.0).abs() < 1e-12);
    }

    #[test]
    fn a_hard_brake_finds_its_branch() {
        // A free wheel of 0.15 kg m² that braking with all that the motor has would turn back four
        // times as fast, in a step of 50 ms.
        let motor = Motor {
            stall_torque: 300.0,
            no_load_speed: 0.5,
            regenerating: true,
        };
        let (h, inertia, begin) = (0.05, 0.15, 20.0);
        let mut drive = DriveTrial::at(Some(&motor), 0.0, begin);
        let mut trials = 0;
        loop {
            let end = match drive.regime() {
                MotorRegime::Constant(torque) => begin + h * torque / inertia,
                MotorRegime::Line { at_rest, slope } => {
                    (inertia * begin + h * at_rest) / (inertia + h * slope)
                }
            };
            if !drive.revise(Some(&motor), 0.0, end) {
                assert!((0.0..1.0).contains(&end), "{end}");
                return;
            }
            trials += 1;
            assert!(trials < 5);
        }
    }

    #[test]
    fn the_torque_never_rises_with_the_speed() {
        for regenerating in [true, false] {
            let motor = Motor {
                stall_torque: 200.0,
                no_load_speed: 17.0,
                regenerating,
            };
            for command in [-150.0, -20.0, 0.0, 3.0, 150.0] {
                let torques: Vec<f64> = (-400..400)
                    .map(|k| motor.torque(command, 0.1 * f64::from(k)))
                    .collect();
                assert!(torques.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
            }
        }
    }
}
