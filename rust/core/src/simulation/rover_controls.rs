//! Controls of a rover: wheel torques and speeds, steering, held joints, brakes.

use super::error::CommandError;
use super::rover::RoverSimulation;
use super::rover_command::check;
use crate::multibody::model::Wheel;
use crate::system::{Command, HeldJoint, Wrench};

/// Commands of wheels, an entry each, positive forward.
#[derive(Clone, Copy, Debug)]
pub enum WheelCommands<'a> {
    /// For [`RoverSimulation::set_wheel_torques`], N m.
    Torques(&'a [f64]),
    /// For [`RoverSimulation::set_wheel_speeds`], rad/s.
    Speeds(&'a [f64]),
}

impl WheelCommands<'_> {
    /// The commands of some of the wheels.
    ///
    /// # Panics
    /// If there are fewer.
    #[must_use]
    pub fn of(self, wheels: std::ops::Range<usize>) -> Self {
        match self {
            Self::Torques(all) => Self::Torques(&all[wheels]),
            Self::Speeds(all) => Self::Speeds(&all[wheels]),
        }
    }

    /// Their number.
    #[must_use]
    pub fn len(self) -> usize {
        let (Self::Torques(all) | Self::Speeds(all)) = self;
        all.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

impl RoverSimulation {
    /// Commanded driving torque of each wheel, positive forward, within its limit (N m).
    #[must_use]
    pub fn wheel_torques(&self) -> &[f64] {
        &self.command.wheel_torque
    }

    /// Sets the driving torques (N m, positive forward); each saturates at its wheel's limit.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_wheel_torques(&mut self, torques: &[f64]) -> Result<(), CommandError> {
        check("torques", torques, self.scene.model.wheels().len())?;
        self.take_wheel_torques(torques);
        Ok(())
    }

    fn take_wheel_torques(&mut self, torques: &[f64]) {
        self.command.wheel_speed = None;
        let wheels = self.scene.model.wheels().iter();
        let own = self.command.wheel_torque.iter_mut();
        for ((own, torque), wheel) in own.zip(torques).zip(wheels) {
            *own = torque.clamp(-wheel.torque_limit, wheel.torque_limit);
        }
        self.combine_torques();
    }

    /// Speeds that the wheels' servos hold, positive forward, rad/s; none while the wheels are
    /// driven by torques.
    #[must_use]
    pub fn wheel_speeds(&self) -> Option<&[f64]> {
        self.command.wheel_speed.as_deref()
    }

    /// Holds the wheels at speeds (rad/s, positive forward) until other commands replace them.
    ///
    /// The torque of a wheel is its gain, [`Wheel::speed_gain`], times the missing speed, taken at
    /// the end of the step, within its torque limit and its motor's line. It is stable at any gain.
    /// The speed counts up to the no-load speed, and the gain is at least the slope of the line.
    /// Wheels that share a joint have the mean of their speeds.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_wheel_speeds(&mut self, speeds: &[f64]) -> Result<(), CommandError> {
        check("speeds", speeds, self.scene.model.wheels().len())?;
        self.take_wheel_speeds(speeds);
        Ok(())
    }

    fn take_wheel_speeds(&mut self, speeds: &[f64]) {
        self.command.wheel_torque.fill(0.0);
        self.command.wheel_speed = Some(speeds.into());
        self.combine_torques();
    }

    /// Sets torques about the joint axes (n_joints, N m).
    ///
    /// A joint with a drive saturates at its limit and on its motor's line. At all others the
    /// torque is additional to the wheels' and has no limit.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_joint_torques(&mut self, torques: &[f64]) -> Result<(), CommandError> {
        check("torques", torques, self.scene.model.n_joints())?;
        let own = self.command.joint_torque.iter_mut().zip(torques);
        for ((own, torque), joint) in own.zip(self.scene.model.joints()) {
            let limit = joint
                .drive
                .map_or(f64::INFINITY, |drive| drive.torque_limit);
            *own = torque.clamp(-limit, limit);
        }
        self.combine_torques();
        Ok(())
    }

    fn combine_torques(&mut self) {
        self.command
            .actuators
            .torque
            .copy_from_slice(&self.command.joint_torque);
        for drive in self.command.actuators.drives.iter_mut().flatten() {
            (drive.torque, drive.servo) = (0.0, None);
        }
        if self.command.wheel_speed.is_some() {
            let servos = self.command.servos(&self.scene.model);
            for (drive, servo) in self.command.actuators.drives.iter_mut().zip(servos) {
                if let Some(drive) = drive {
                    drive.servo = servo;
                }
            }
        }
        let Command { torque, drives, .. } = &mut self.command.actuators;
        for ((torque, drive), joint) in torque.iter_mut().zip(drives).zip(self.scene.model.joints())
        {
            if let (Some(drive), Some(_)) = (drive, joint.drive) {
                drive.torque = std::mem::take(torque);
            }
        }
        for (wheel, torque) in self
            .scene
            .model
            .wheels()
            .iter()
            .zip(&self.command.wheel_torque)
        {
            if let Some(drive) = wheel
                .joint
                .and_then(|j| self.command.actuators.drives[j].as_mut())
            {
                drive.torque += wheel.drive_sign * torque;
            }
        }
    }

    /// Steering set-point of each wheel, rad; 0 where its steering is not held or is locked.
    #[must_use]
    pub fn steering(&self) -> Vec<f64> {
        let of = |j: usize| self.command.actuators.held[j].map_or(0.0, |h| h.set_point);
        self.model()
            .wheels()
            .iter()
            .map(|w| w.steering.map_or(0.0, of))
            .collect()
    }

    /// Holds the steering joints at set-points (rad, one a wheel) with the model's gains.
    ///
    /// # Errors
    /// Wrong length, not finite, beyond the wheel's limit, or nonzero where
    /// there is no free steering joint.
    pub fn set_steering(&mut self, set_points: &[f64]) -> Result<(), CommandError> {
        self.check_steering(set_points)?;
        self.take_steering(set_points);
        Ok(())
    }

    fn take_steering(&mut self, set_points: &[f64]) {
        for (&set_point, wheel) in set_points.iter().zip(self.scene.model.wheels()) {
            if let Some(j) = wheel.steering {
                let hold = self.scene.model.hold(j);
                let held = self.command.actuators.held[j];
                let (stiffness, damping) =
                    held.map_or((hold.stiffness, hold.damping), |h| (h.stiffness, h.damping));
                self.command.actuators.held[j] = Some(HeldJoint {
                    set_point,
                    stiffness,
                    damping,
                });
            }
        }
    }

    fn check_steering(&self, set_points: &[f64]) -> Result<(), CommandError> {
        check("set_points", set_points, self.scene.model.wheels().len())?;
        for (index, (&value, wheel)) in set_points.iter().zip(self.scene.model.wheels()).enumerate()
        {
            let limit = if wheel.steering.is_some() {
                wheel.steering_limit
            } else {
                0.0
            };
            if value.abs() > limit * (1.0 + 1e-12) {
                return Err(CommandError::BeyondLimit {
                    field: "set_points",
                    index,
                    value,
                    limit,
                });
            }
        }
        Ok(())
    }

    /// [`Self::set_wheel_torques`] and [`Self::set_steering`] in one: both or neither.
    ///
    /// # Errors
    /// As these two; nothing is changed then.
    pub fn set_commands(
        &mut self,
        torques: &[f64],
        set_points: &[f64],
    ) -> Result<(), CommandError> {
        let commands = WheelCommands::Torques(torques);
        self.check_commands(commands, set_points)?;
        self.take_commands(commands, set_points);
        Ok(())
    }

    /// [`Self::set_wheel_speeds`] and [`Self::set_steering`] in one: both or neither.
    ///
    /// # Errors
    /// As these two; nothing is changed then.
    pub fn set_speed_commands(
        &mut self,
        speeds: &[f64],
        set_points: &[f64],
    ) -> Result<(), CommandError> {
        let commands = WheelCommands::Speeds(speeds);
        self.check_commands(commands, set_points)?;
        self.take_commands(commands, set_points);
        Ok(())
    }

    /// [`Self::set_commands`] after [`Self::check_commands`].
    pub(super) fn take_commands(&mut self, wheels: WheelCommands<'_>, set_points: &[f64]) {
        match wheels {
            WheelCommands::Torques(torques) => self.take_wheel_torques(torques),
            WheelCommands::Speeds(speeds) => self.take_wheel_speeds(speeds),
        }
        self.take_steering(set_points);
    }

    /// Checks whether [`Self::set_wheel_torques`] or [`Self::set_wheel_speeds`], and
    /// [`Self::set_steering`], would accept these.
    ///
    /// # Errors
    /// As these.
    pub fn check_commands(
        &self,
        wheels: WheelCommands<'_>,
        set_points: &[f64],
    ) -> Result<(), CommandError> {
        let (field, values) = match wheels {
            WheelCommands::Torques(torques) => ("torques", torques),
            WheelCommands::Speeds(speeds) => ("speeds", speeds),
        };
        check(field, values, self.scene.model.wheels().len())?;
        self.check_steering(set_points)
    }

    /// Holds joints by name; set-points default to the current positions, gains to the model's.
    ///
    /// # Errors
    /// An unknown joint, a wrong number of set-points, a gain that is
    /// negative or not finite; nothing is changed then.
    pub fn hold(
        &mut self,
        joints: &[String],
        set_points: Option<&[f64]>,
        stiffness: Option<f64>,
        damping: Option<f64>,
    ) -> Result<(), CommandError> {
        let indices = self.joint_indices(joints)?;
        if let Some(points) = set_points {
            check("set_points", points, joints.len())?;
        }
        for (field, gain) in [("stiffness", stiffness), ("damping", damping)] {
            if let Some(value) = gain {
                check(field, &[value], 1)?;
                if value < 0.0 {
                    return Err(CommandError::Negative { field, value });
                }
            }
        }
        let gains = |j: usize| {
            let hold = self.scene.model.hold(j);
            let stiffness = stiffness.unwrap_or(hold.stiffness);
            (stiffness, damping.unwrap_or(hold.damping))
        };
        for &j in &indices {
            self.check_gains(j, gains(j))?;
        }
        let gains: Vec<_> = indices.iter().map(|&j| gains(j)).collect();
        for ((i, &j), (stiffness, damping)) in indices.iter().enumerate().zip(gains) {
            self.command.actuators.held[j] = Some(HeldJoint {
                set_point: set_points.map_or(self.state.configuration.joints[j], |p| p[i]),
                stiffness,
                damping,
            });
        }
        Ok(())
    }

    /// Refuses to hold a joint whose stiffness and damping are 0: nothing would hold it.
    fn check_gains(&self, j: usize, (stiffness, damping): (f64, f64)) -> Result<(), CommandError> {
        if stiffness > 0.0 || damping > 0.0 {
            return Ok(());
        }
        let name = &self.scene.model.bodies()[self.scene.model.joints()[j].body].name;
        let mut solids = self.scene.model.description().solids.iter();
        Err(CommandError::NoGains {
            solid: solids.position(|solid| solid.name == *name).unwrap_or(0),
            name: name.clone(),
        })
    }

    /// Checks that the model states gains for every wheel that [`Self::brake`] holds. A caster,
    /// whose torque limit is 0, may roll on without, if another wheel is held.
    ///
    /// # Errors
    /// The first wheel without gains.
    pub fn check_brakes(&self) -> Result<(), CommandError> {
        let model = &self.scene.model;
        let check = |j: usize| {
            let hold = model.hold(j);
            self.check_gains(j, (hold.stiffness, hold.damping))
        };
        let of = |wheel: &Wheel| wheel.joint.map_or(Ok(()), check);
        let is_any_held = model.wheels().iter().any(|wheel| of(wheel).is_ok());
        let needed = |wheel: &&Wheel| wheel.torque_limit > 0.0 || !is_any_held;
        model.wheels().iter().filter(needed).try_for_each(of)
    }

    /// Releases joints by name.
    ///
    /// # Errors
    /// An unknown joint; nothing is changed then.
    pub fn release(&mut self, joints: &[String]) -> Result<(), CommandError> {
        for j in self.joint_indices(joints)? {
            self.command.actuators.held[j] = None;
        }
        Ok(())
    }

    /// Holds all wheels where they are and sets their torques to zero. Wheels without gains stay
    /// free: [`Self::check_brakes`].
    pub fn brake(&mut self) {
        self.command.wheel_torque.fill(0.0);
        self.command.wheel_speed = None;
        self.combine_torques();
        for wheel in self.scene.model.wheels() {
            if let Some(j) = wheel.joint {
                let hold = self.scene.model.hold(j);
                let set_point = self.state.configuration.joints[j];
                self.command.actuators.held[j] = Some(HeldJoint {
                    set_point,
                    stiffness: hold.stiffness,
                    damping: hold.damping,
                });
            }
        }
    }

    /// Applies a force (N) at a point of a solid (m, in its frame) and a moment (N m), both in
    /// world axes, in all further steps. Replaces the last wrench on this solid; one without force
    /// and moment removes it.
    ///
    /// # Errors
    /// An unknown solid, an entry that is not finite; nothing is changed then.
    pub fn apply_wrench(
        &mut self,
        solid: &str,
        force: [f64; 3],
        moment: [f64; 3],
        point: [f64; 3],
    ) -> Result<(), CommandError> {
        for (field, values) in [("force", force), ("moment", moment), ("point", point)] {
            check(field, &values, 3)?;
        }
        let mut frames = self.scene.model.frames().iter();
        let found = frames.position(|frame| frame.name == solid);
        let solid = found.ok_or_else(|| CommandError::UnknownSolid {
            field: "solid",
            name: solid.to_owned(),
        })?;
        let wrenches = &mut self.command.actuators.wrenches;
        wrenches.retain(|wrench| wrench.solid != solid);
        if (force, moment) != ([0.0; 3], [0.0; 3]) {
            wrenches.push(Wrench {
                solid,
                point,
                force,
                moment,
            });
        }
        Ok(())
    }

    /// Removes all wrenches.
    pub fn clear_wrenches(&mut self) {
        self.command.actuators.wrenches.clear();
    }

    fn joint_indices(&self, joints: &[String]) -> Result<Vec<usize>, CommandError> {
        let index = |name: &String| {
            let found = self.scene.model.joint_index(name);
            found.ok_or_else(|| CommandError::UnknownJoint {
                field: "joints",
                name: name.clone(),
            })
        };
        joints.iter().map(index).collect()
    }
}
