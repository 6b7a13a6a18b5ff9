//! Torque–speed line of a wheel motor, and the servo that may command it.
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
//! A servo commands a speed ω_s instead of a torque:
//!
//! ```text
//! τ = k (ω_s − ω),  within ± limit and ± stall (1 ∓ ω/ω₀);  k ≥ stall/ω₀, |ω_s| ≤ ω₀
//! ```
//!
//! With these bounds on gain and speed the torque falls with the rate, and the line limits only the
//! torque towards ω_s. A branch of the torque is linear in the rate and enters the step implicitly,
//! so the servo is stable at any gain. A row of the contact problem, like the one of dry friction,
//! would be as stable, but it would make the problem larger in every step. A branch costs nothing
//! until the torque reaches or leaves a limit, where the step is taken once more.
//!
//! Source: the permanent-magnet DC motor at its supply voltage, e.g. Siciliano et al. 2009,
//! *Robotics*, ch. 5.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use serde::{Deserialize, Deserializer, Serialize};

use super::description::check_values::within;
use super::error::ModelError;
use crate::scalar::{Lane, LaneMask, Single};

/// A torque–speed line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// Torque of the line at rest, N m.
    pub stall_torque: f64,
    /// ω₀, the zero of the line, rad/s; may be infinite (null in JSON, which has no infinity).
    #[serde(deserialize_with = "speed")]
    pub no_load_speed: f64,
    /// Whether the motor brakes when driven faster than ω₀.
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

impl Motor {
    /// Checks the ranges; `at` makes a field's full name.
    ///
    /// # Errors
    /// The first number out of its range.
    pub fn check(&self, at: impl Fn(&str) -> String) -> Result<(), ModelError> {
        let (torque, speed) = (self.stall_torque, self.no_load_speed);
        let range = "from 1e-9 to 1e9 N m";
        within(
            TORQUES.contains(&torque),
            &at("stall_torque"),
            torque,
            range,
        )?;
        let is_within = SPEEDS.contains(&speed) || speed.is_infinite() && speed > 0.0;
        let range = "from 1e-6 to 1e9 rad/s, or infinite";
        within(is_within, &at("no_load_speed"), speed, range)
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

    /// Torque for a command (N m) at a rate (rad/s), N m.
    #[must_use]
    pub fn torque(&self, command: f64, rate: f64) -> f64 {
        let mut line = MotorLine::new(Single::Baseline);
        line.set_lane(0, Some(self), command, None);
        line.choose(rate);
        line.torque(rate)
    }
}

/// A servo that drives a joint towards a speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// ω_s, the rate of the joint that it is to have, rad/s.
    pub speed: f64,
    /// k, torque for each rad/s that is missing, N m s/rad; positive.
    pub gain: f64,
    /// Largest torque, N m; positive.
    pub limit: f64,
}

/// Largest gain of a servo, as a multiple of the inertia of its joint over the time step.
///
/// A step reaches the speed at any larger gain, too, but the torque k (ω_s − ω) would then consist
/// of rounding: with 10¹² instead, the energy audit slowed a wheel by 10⁻⁴ of its speed.
const STIFFEST: f64 = 1e6;

/// The branch on which the torque is the command, or follows the servo.
const COMMAND: f64 = 2.0;

/// Drives with their commands and the present branches of their torques in a step, a drive a lane.
///
/// Branches are numbered from 0 to 4 in the order of the rate; on each the torque is
/// `at_rest − active ω`. A step with one branch yields the rate at its end, and thus the side of
/// the branch on which the motor works. For a single wheel, moving one branch at a time terminates
/// after at most four steps, since the torque falls with the rate. Jumping directly to the branch
/// of that rate may alternate forever.
///
/// The branches of a servo have the same numbers: its limit, the line, the servo, the line against
/// it, minus its limit. A line that the servo does not meet is passed over.
#[derive(Clone, Copy, Debug)]
pub struct MotorLine<T> {
    /// Command within the stall torque, N m; 0 without a drive.
    command: T,
    /// Stall torque, N m; infinite without a motor.
    stall: T,
    /// Slope of the torque–speed line, N m s/rad; 0 without a motor.
    slope: T,
    /// How far the line is followed beyond the no-load speed, forwards and backwards, N m.
    beyond: [T; 2],
    branch: T,
    at_rest: T,
    active: T,
    /// Rate at which the torque of the present branch is `at_rest`, rad/s; 0 but on a servo.
    centre: T,
    servo: ServoLine<T>,
}

/// Servos of the drives, a drive a lane.
#[derive(Clone, Copy, Debug)]
struct ServoLine<T> {
    /// Whether any lane has a servo.
    is_any: bool,
    /// k, at least the slope of the motor's line, N m s/rad; 0 without a servo.
    stated: T,
    /// k, within [`STIFFEST`] in the present step.
    gain: T,
    /// ω_s within the motor's no-load speed, rad/s.
    speed: T,
    /// Largest torque, N m.
    limit: T,
}

impl<T: Lane> MotorLine<T> {
    /// Without drives.
    #[must_use]
    pub fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            command: zero,
            stall: T::splat(token, f64::INFINITY),
            slope: zero,
            beyond: [zero; 2],
            branch: T::splat(token, COMMAND),
            at_rest: zero,
            active: zero,
            centre: zero,
            servo: ServoLine {
                is_any: false,
                stated: zero,
                gain: zero,
                speed: zero,
                limit: zero,
            },
        }
    }

    /// Sets the command of a lane, N m; without a motor it is the torque at any speed. With a servo
    /// the command is not read. [`Self::choose`] follows if there is a motor or a servo.
    pub fn set_lane(
        &mut self,
        lane: usize,
        motor: Option<&Motor>,
        command: f64,
        servo: Option<&Servo>,
    ) {
        let limited = motor.map_or(command, |motor| motor.limited(command));
        let stall = motor.map_or(f64::INFINITY, |motor| motor.stall_torque);
        let beyond = |towards: f64| match motor {
            Some(motor) if motor.regenerating => stall,
            _ => towards.max(0.0),
        };
        // No negative zeros: skipped terms must not show in any bit.
        self.command.set(lane, limited + 0.0);
        self.stall.set(lane, stall);
        self.slope.set(lane, motor.map_or(0.0, Motor::slope));
        self.beyond[0].set(lane, beyond(limited));
        self.beyond[1].set(lane, beyond(-limited));
        self.branch.set(lane, COMMAND);
        self.at_rest.set(lane, limited + 0.0);
        self.active.set(lane, 0.0);
        self.centre.set(lane, 0.0);
        self.servo.set_lane(lane, motor, servo);
    }

    /// Adds to the command, or to the speed of a servo; [`Self::choose`] follows if there is a
    /// motor or a servo.
    #[inline(always)]
    pub fn add_command(&mut self, change: T) {
        if self.servo.is_any {
            let served = self.servo.lanes();
            self.servo.speed = T::select(served, self.servo.speed + change, self.servo.speed);
        }
        let command = (self.command + change).min(self.stall).max(-self.stall);
        self.command = command;
        self.at_rest = command;
        for (beyond, towards) in self.beyond.iter_mut().zip([command, -command]) {
            let is_whole = self.stall.le(*beyond);
            *beyond = T::select(is_whole, *beyond, towards.max(command.like(0.0)));
        }
    }

    /// Whether any lane has a motor or a servo.
    #[inline(always)]
    #[must_use]
    pub fn has_branches(&self) -> bool {
        self.servo.is_any || self.stall.lt(self.stall.like(f64::INFINITY)).any()
    }

    /// Steepest slope of the torque whatever the branch, N m s/rad.
    #[inline(always)]
    #[must_use]
    pub fn slope(&self) -> T {
        if self.servo.is_any {
            return self.slope.max(self.servo.gain);
        }
        self.slope
    }

    /// Damping of the present branch, N m s/rad.
    #[inline(always)]
    #[must_use]
    pub fn damping(&self) -> T {
        self.active
    }

    /// Torque of the present branch at rest, N m.
    #[inline(always)]
    #[must_use]
    pub fn at_rest(&self) -> T {
        self.at_rest
    }

    /// Limits the gain of a servo for a step of h (s) and an inertia of its joint (kg m²).
    #[inline(always)]
    pub fn limit_gain(&mut self, h: T, inertia: T) {
        if self.servo.is_any {
            let most = h.like(STIFFEST) * inertia / h;
            self.servo.gain = self.servo.stated.min(most.max(self.slope));
            self.take(self.branch);
        }
    }

    /// Torque of the present branch at a rate (rad/s), N m.
    #[inline(always)]
    #[must_use]
    pub fn torque(&self, rate: T) -> T {
        self.at_rest - self.active * (rate - self.centre)
    }

    /// Work (J) that the motor is credited with in a step that turns it by `turned` (rad) at the
    /// mean `torque` (N m).
    ///
    /// A torque–speed line only reduces the power of the command, `(τ − command) ω ≤ 0`. In a step
    /// that reverses the rate, the implicit torque and the mean rate may violate this; the surplus
    /// is not counted as work. A servo has the work of its torque.
    #[inline(always)]
    #[must_use]
    pub fn work(&self, torque: T, turned: T) -> T {
        let commanded = (torque * turned).min(self.command * turned);
        if self.servo.is_any {
            return T::select(self.servo.lanes(), torque * turned, commanded);
        }
        commanded
    }

    /// Takes the branch that holds at a rate, rad/s.
    #[inline(always)]
    pub fn choose(&mut self, rate: T) {
        // What the last step left must not show in the branch.
        self.servo.gain = self.servo.stated;
        self.take(self.branch_at(rate));
    }

    /// Moves one branch towards that of a rate (rad/s) in the lanes of a mask. Returns those in
    /// which the torque changed.
    #[inline(always)]
    pub fn revise(&mut self, lanes: T::Mask, rate: T) -> T::Mask {
        let wanted = self.branch_at(rate);
        let changed = self.approach(lanes, wanted);
        if !self.servo.is_any {
            return changed;
        }
        changed | self.approach(lanes & !changed & self.servo.lanes(), wanted)
    }

    /// Moves one branch towards a wanted one in the lanes of a mask. Returns those in which the
    /// torque changed.
    #[inline(always)]
    fn approach(&mut self, lanes: T::Mask, wanted: T) -> T::Mask {
        let one = wanted.like(1.0);
        let wanted = wanted.max(self.branch - one).min(self.branch + one);
        let (before, slope) = (self.at_rest, self.active);
        self.take(T::select(lanes, wanted, self.branch));
        let is_same = before.le(self.at_rest)
            & self.at_rest.le(before)
            & slope.le(self.active)
            & self.active.le(slope);
        lanes & !is_same
    }

    /// Number of the branch at a rate.
    #[inline(always)]
    fn branch_at(&self, rate: T) -> T {
        let number = |x: f64| rate.like(x);
        let drop = self.slope * rate;
        let (upper, lower) = (self.stall - drop, -self.stall - drop);
        let [ahead, back] = self.beyond;
        let is_above = upper.lt(self.command);
        let is_below = self.command.lt(lower);
        let mut branch = T::select(is_above, number(COMMAND + 1.0), number(COMMAND));
        branch = T::select(is_above & upper.lt(-back), number(COMMAND + 2.0), branch);
        branch = T::select(is_below, number(COMMAND - 1.0), branch);
        branch = T::select(is_below & ahead.lt(lower), number(COMMAND - 2.0), branch);
        if self.servo.is_any {
            let served = self.servo.branch_at(rate, [upper, lower]);
            branch = T::select(self.servo.lanes(), served, branch);
        }
        branch
    }

    /// Takes the torque of a branch.
    #[inline(always)]
    fn take(&mut self, branch: T) {
        let number = |x: f64| branch.like(x);
        let [ahead, back] = self.beyond;
        let is_on_line = |x: f64| branch.ge(number(x)) & branch.le(number(x));
        let (upper, lower) = (is_on_line(COMMAND + 1.0), is_on_line(COMMAND - 1.0));
        let mut at_rest = T::select(upper, self.stall, self.command);
        at_rest = T::select(number(COMMAND + 1.0).lt(branch), -back, at_rest);
        at_rest = T::select(lower, -self.stall, at_rest);
        at_rest = T::select(branch.lt(number(COMMAND - 1.0)), ahead, at_rest);
        self.branch = branch;
        self.at_rest = at_rest;
        self.active = T::select(upper | lower, self.slope, number(0.0));
        if self.servo.is_any {
            self.take_served(branch);
        }
    }

    /// Takes the torque of a branch in the lanes with a servo.
    #[inline(always)]
    fn take_served(&mut self, branch: T) {
        let number = |x: f64| branch.like(x);
        let is_on = |x: f64| branch.ge(number(x)) & branch.le(number(x));
        let ServoLine {
            gain, speed, limit, ..
        } = self.servo;
        let served = self.servo.lanes();
        // The rates at which the servo alone would reach its limit.
        let reach = limit / T::select(served, gain, number(1.0));
        let drop = |rate: T| self.slope * rate;
        let cuts_ahead = is_on(COMMAND - 1.0) & (self.stall - drop(speed - reach)).lt(limit);
        let cuts_back = is_on(COMMAND + 1.0) & (-limit).lt(-self.stall - drop(speed + reach));
        let is_servo = is_on(COMMAND);
        let mut at_rest = T::select(branch.lt(number(COMMAND)), limit, -limit);
        at_rest = T::select(cuts_ahead, self.stall, at_rest);
        at_rest = T::select(cuts_back, -self.stall, at_rest);
        at_rest = T::select(is_servo, number(0.0), at_rest);
        let mut active = T::select(cuts_ahead | cuts_back, self.slope, number(0.0));
        active = T::select(is_servo, gain, active);
        self.at_rest = T::select(served, at_rest, self.at_rest);
        self.active = T::select(served, active, self.active);
        self.centre = T::select(served & is_servo, speed, number(0.0));
    }
}

impl<T: Lane> ServoLine<T> {
    fn set_lane(&mut self, lane: usize, motor: Option<&Motor>, servo: Option<&Servo>) {
        let fastest = motor.map_or(f64::INFINITY, |motor| motor.no_load_speed);
        let steepest = motor.map_or(0.0, Motor::slope);
        let gain = servo.map_or(0.0, |servo| servo.gain.max(steepest));
        let speed = servo.map_or(0.0, |servo| servo.speed.clamp(-fastest, fastest));
        let limit = servo.map_or(0.0, |own| motor.map_or(own.limit, |m| m.limited(own.limit)));
        self.stated.set(lane, gain);
        self.gain.set(lane, gain);
        self.speed.set(lane, speed + 0.0);
        self.limit.set(lane, limit);
        self.is_any = self.lanes().any();
    }

    /// Lanes with a servo.
    #[inline(always)]
    fn lanes(&self) -> T::Mask {
        self.gain.like(0.0).lt(self.gain)
    }

    /// Number of the branch at a rate where the motor's line is at these torques.
    #[inline(always)]
    fn branch_at(&self, rate: T, [upper, lower]: [T; 2]) -> T {
        let number = |x: f64| rate.like(x);
        let asked = self.gain * (self.speed - rate);
        let (upper, lower) = (upper.min(self.limit), lower.max(-self.limit));
        let mut branch = T::select(upper.lt(asked), number(COMMAND - 1.0), number(COMMAND));
        let is_at_limit = self.limit.lt(asked) & self.limit.le(upper);
        branch = T::select(is_at_limit, number(COMMAND - 2.0), branch);
        branch = T::select(asked.lt(lower), number(COMMAND + 1.0), branch);
        let is_at_limit = asked.lt(-self.limit) & lower.le(-self.limit);
        T::select(is_at_limit, number(COMMAND + 2.0), branch)
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
