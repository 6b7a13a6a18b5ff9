//! Torque–speed line of a wheel motor.
//!
//! ```text
//! τ = command, within ± stall (1 ∓ ω/ω₀) and ± stall
//! ```
//!
//! Below the line the torque is the command. On it the torque falls linearly with the speed and reaches zero at the no-load speed ω₀, where
//! the back-EMF equals the supply. A motor that regenerates brakes when it is driven faster, by the line and at most by the stall torque; one
//! that does not turns freely, and brakes by command alone. With an infinite ω₀ the torque is the command within ± stall, at any speed.
//!
//! Source: the permanent-magnet DC motor at its supply voltage, e.g. Siciliano et al. 2009, *Robotics*, ch. 5.

use serde::{Deserialize, Deserializer, Serialize};

use super::error::ModelError;

/// A torque–speed line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// Torque of the line at rest, N m.
    pub stall_torque: f64,
    /// ω₀, where the line reaches zero, rad/s; may be infinite (in JSON, which has no infinity: null).
    #[serde(deserialize_with = "speed")]
    pub no_load_speed: f64,
    /// Whether it brakes when it is driven faster than ω₀.
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

/// How the torque depends on the speed nearby.
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

    /// The branch that holds for a command (N m) at a rate (rad/s), both about the joint's axis.
    #[inline]
    #[must_use]
    pub fn regime(&self, command: f64, rate: f64) -> MotorRegime {
        let (stall, slope) = (self.stall_torque, self.slope());
        let (upper, lower) = (stall - slope * rate, -stall - slope * rate);
        // Beyond the no-load speed: how far the line is followed.
        let end = |towards: f64| {
            if self.regenerating {
                stall
            } else {
                towards.max(0.0)
            }
        };
        if command > upper {
            if upper < -end(-command) {
                return MotorRegime::Constant(-end(-command));
            }
            return MotorRegime::Line {
                at_rest: stall,
                slope,
            };
        }
        if command < lower {
            if lower > end(command) {
                return MotorRegime::Constant(end(command));
            }
            return MotorRegime::Line {
                at_rest: -stall,
                slope,
            };
        }
        MotorRegime::Constant(command.clamp(-stall, stall))
    }

    /// Torque for a command (N m) at a rate (rad/s), N m.
    #[must_use]
    pub fn torque(&self, command: f64, rate: f64) -> f64 {
        self.regime(command, rate).torque(rate)
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
            (-150.0, -20.0, -100.0),
            (0.0, -33.0, 30.0),
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
