//! The command of a rover: wheel torques, steering, held joints.

use serde::{Deserialize, Serialize};

use super::error::CommandError;
use crate::multibody::{Model, Servo};
use crate::system::{Command, Drive, HeldJoint};

/// Torques and set-points of a rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverCommand {
    /// Commands of the actuators.
    pub actuators: Command,
    /// Driving torque of each wheel, positive forward, N m.
    pub wheel_torque: Vec<f64>,
    /// Speed of each wheel that its servo is to hold, positive forward, rad/s; none while torques
    /// drive the wheels.
    pub wheel_speed: Option<Box<[f64]>>,
    /// Torque about each joint's axis, N m: its drive's where it has one, else additional.
    pub joint_torque: Vec<f64>,
}

impl RoverCommand {
    /// No torque; steering joints held at zero with the model's gains, all others free.
    #[must_use]
    pub fn idle(model: &Model) -> Self {
        let mut actuators = Command::idle(model);
        for (drive, joint) in actuators.drives.iter_mut().zip(model.joints()) {
            *drive = joint.drive.map(|drive| Drive {
                torque: 0.0,
                motor: drive.motor,
                servo: None,
            });
        }
        for wheel in model.wheels() {
            if let Some(j) = wheel.joint {
                actuators.drives[j] = Some(Drive {
                    torque: 0.0,
                    motor: wheel.motor,
                    servo: None,
                });
            }
            if let Some(j) = wheel.steering {
                let hold = model.hold(j);
                actuators.held[j] = Some(HeldJoint {
                    set_point: 0.0,
                    stiffness: hold.stiffness,
                    damping: hold.damping,
                });
            }
        }
        Self {
            actuators,
            wheel_torque: vec![0.0; model.wheels().len()],
            wheel_speed: None,
            joint_torque: vec![0.0; model.n_joints()],
        }
    }

    /// Servo of each joint (n_joints) that is to hold the wheels' speeds: gains and torque limits
    /// of wheels with one joint add up, and the speed is the mean of theirs, weighted by the gains.
    pub(super) fn servos(&self, model: &Model) -> Vec<Option<Servo>> {
        let mut servos = vec![None; model.n_joints()];
        let speeds = self.wheel_speed.iter().flatten();
        for (wheel, speed) in model.wheels().iter().zip(speeds) {
            let Some(j) = wheel.joint.filter(|_| wheel.torque_limit > 0.0) else {
                continue;
            };
            let own = servos[j].get_or_insert(Servo {
                speed: 0.0,
                gain: 0.0,
                limit: 0.0,
            });
            own.gain += wheel.speed_gain;
            own.limit += wheel.torque_limit;
            let missing = wheel.drive_sign * speed - own.speed;
            own.speed += wheel.speed_gain / own.gain * missing;
        }
        servos
    }

    /// Whether the command fits this model and its motors, and all of its numbers are finite.
    pub(super) fn is_of(&self, model: &Model) -> bool {
        let own = Self::idle(model);
        let Command {
            torque,
            drives,
            held,
            wrenches,
        } = &self.actuators;
        let servos = self.servos(model);
        let is_drive = |((theirs, own), servo): ((&Option<Drive>, &Option<Drive>), &_)| {
            theirs.is_some() == own.is_some()
                && theirs.and_then(|d| d.servo) == *servo
                && theirs.is_none_or(|d| d.torque.is_finite())
                && theirs.and_then(|d| d.motor) == own.and_then(|d| d.motor)
        };
        let gains = held.iter().flatten();
        let gains = gains.flat_map(|h| [h.set_point, h.stiffness, h.damping]);
        let torques = [torque, &self.wheel_torque, &self.joint_torque];
        let speeds = self.wheel_speed.as_ref();
        let n_wheels = own.wheel_torque.len();
        self.wheel_torque.len() == n_wheels
            && speeds.is_none_or(|own| own.len() == n_wheels && own.iter().all(|x| x.is_finite()))
            && [
                torque.len(),
                self.joint_torque.len(),
                held.len(),
                drives.len(),
            ] == [model.n_joints(); 4]
            && (drives.iter().zip(&own.actuators.drives).zip(&servos)).all(is_drive)
            && torques.into_iter().flatten().all(|x| x.is_finite())
            && gains.into_iter().all(f64::is_finite)
            && wrenches.iter().all(|wrench| wrench.is_of(model))
    }
}

/// A command of `expected` finite entries.
pub(super) fn check(
    field: &'static str,
    values: &[f64],
    expected: usize,
) -> Result<(), CommandError> {
    if values.len() != expected {
        return Err(CommandError::Length {
            field,
            expected,
            actual: values.len(),
        });
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(CommandError::NotFinite {
            field,
            index,
            value: values[index],
        }),
        None => Ok(()),
    }
}
