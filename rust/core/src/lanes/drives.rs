//! Torques, motors and held joints of the rovers of a block.
//!
//! The formulas are those of [`crate::system`]: position control and the motors' torque–speed lines
//! are implicit with an exponentially fitted θ_j. A motor that changes its branch within a step is
//! not ordinary.

use super::machine::{Machine, velocity};
use crate::multibody::Motor;
use crate::scalar::elementary::exp_m1;
use crate::scalar::{Lane, LaneMask};
use crate::system::Command;

/// Command of one joint in every lane, and its motor in the present step.
#[derive(Clone, Copy, Debug)]
struct Joint<T> {
    /// Torque apart from the drive's, N m.
    torque: T,
    /// Command of the drive within the stall torque, N m; 0 without a drive.
    command: T,
    /// Stall torque, N m; infinite without a motor.
    stall: T,
    /// Slope of the torque–speed line, N m s/rad; 0 without a motor.
    slope: T,
    /// How far the line is followed beyond the no-load speed, forwards and backwards, N m.
    beyond: [T; 2],
    /// Gains and set-point of the position control; 0 where the joint is free.
    stiffness: T,
    damping: T,
    set_point: T,
    /// Present branch: torque `at_rest − active ω`.
    at_rest: T,
    active: T,
    /// Implicit weight θ_j.
    theta: T,
}

/// Commands of all joints of a block.
#[derive(Clone, Debug)]
pub struct Drives<T> {
    joints: Vec<Joint<T>>,
    /// Joints that have a motor or are held in some lane.
    is_implicit: Vec<bool>,
    /// Impulse (N m s) and work (J) of each joint's drive in the step being tried.
    tried: Vec<[T; 2]>,
    /// Impulse of each joint's drive in the last step, and work since the call began.
    done: Vec<[T; 2]>,
}

impl<T: Lane> Drives<T> {
    /// No torque, nothing held.
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = T::splat(token, 0.0);
        let joint = Joint {
            torque: zero,
            command: zero,
            stall: T::splat(token, f64::INFINITY),
            slope: zero,
            beyond: [zero; 2],
            stiffness: zero,
            damping: zero,
            set_point: zero,
            at_rest: zero,
            active: zero,
            theta: T::splat(token, 0.5),
        };
        Self {
            joints: vec![joint; machine.n_joints()],
            is_implicit: vec![false; machine.n_joints()],
            tried: vec![[zero; 2]; machine.n_joints()],
            done: vec![[zero; 2]; machine.n_joints()],
        }
    }

    /// Sets the command of a lane, and the work of each drive since the call began (n_joints), J.
    /// [`Self::finish_loading`] follows after all lanes.
    pub fn set_lane(&mut self, lane: usize, command: &Command, work: &[f64]) {
        for (done, work) in self.done.iter_mut().zip(work) {
            done[1].set(lane, *work);
        }
        let drives = command.drives.iter().zip(&command.held);
        for ((joint, torque), (drive, held)) in
            self.joints.iter_mut().zip(&command.torque).zip(drives)
        {
            let motor = drive.and_then(|drive| drive.motor);
            let asked = drive.map_or(0.0, |drive| drive.torque);
            let limited = motor.map_or(asked, |motor| motor.limited(asked));
            let is_regenerating = motor.is_some_and(|motor| motor.regenerating);
            let stall = motor.map_or(f64::INFINITY, |motor| motor.stall_torque);
            let beyond = |towards: f64| {
                if is_regenerating {
                    stall
                } else {
                    towards.max(0.0)
                }
            };
            // No negative zeros: skipped terms must not show in any bit.
            joint.torque.set(lane, *torque + 0.0);
            joint.command.set(lane, limited + 0.0);
            joint.stall.set(lane, stall);
            joint
                .slope
                .set(lane, motor.as_ref().map_or(0.0, Motor::slope));
            joint.beyond[0].set(lane, beyond(limited));
            joint.beyond[1].set(lane, beyond(-limited));
            let (stiffness, damping, set_point) =
                held.map_or((0.0, 0.0, 0.0), |h| (h.stiffness, h.damping, h.set_point));
            joint.stiffness.set(lane, stiffness);
            joint.damping.set(lane, damping);
            joint.set_point.set(lane, set_point);
        }
    }

    /// Writes the work of a lane's drives since the call began, J.
    pub fn to_lane(&self, lane: usize, work: &mut [f64]) {
        for (work, done) in work.iter_mut().zip(&self.done) {
            *work = done[1].get(lane);
        }
    }

    /// Impulse of a joint's drive in a lane's last step, N m s.
    #[must_use]
    pub fn impulse(&self, lane: usize, joint: usize) -> f64 {
        self.done[joint][0].get(lane)
    }

    /// The step whose work was last requested becomes the last one, in the lanes of a mask.
    #[inline(always)]
    pub fn accept(&mut self, lanes: T::Mask) {
        for (done, tried) in self.done.iter_mut().zip(&self.tried) {
            done[0] = T::select(lanes, tried[0], done[0]);
            done[1] = T::select(lanes, done[1] + tried[1], done[1]);
        }
    }

    /// Notes which joints need implicit terms.
    pub fn finish_loading(&mut self) {
        for (is_implicit, joint) in self.is_implicit.iter_mut().zip(&self.joints) {
            let zero = joint.slope.like(0.0);
            *is_implicit =
                (zero.lt(joint.slope) | zero.lt(joint.damping) | zero.lt(joint.stiffness)).any();
        }
    }

    /// Chooses each motor's branch for the rates at the start of the step, and θ_j for the
    /// `inertia` of each body's joint (diagonal of M), kg m².
    #[inline(always)]
    pub fn choose(
        &mut self,
        machine: &Machine,
        (h, theta): (T, T),
        v: &[T],
        inertia: impl Fn(usize) -> T,
    ) {
        for j in 0..machine.n_joints() {
            let k = velocity(j + 1);
            let joint = &mut self.joints[j];
            (joint.at_rest, joint.active) = joint.branch(v[k]);
            joint.theta = theta;
            if self.is_implicit[j] {
                let (damping, stiffness) = (joint.slope + joint.damping, joint.stiffness);
                let zero = damping.like(0.0);
                let z = h * (damping + damping.like(0.5) * h * stiffness) / inertia(j + 1);
                let is_stiff = zero.lt(damping) | zero.lt(stiffness);
                joint.theta = T::select(is_stiff, fitted_theta(z).max(theta), theta);
            }
        }
    }

    /// Calls `add(b, a)` with the implicit term a of every body b whose joint has one.
    #[inline(always)]
    pub fn add_implicit(
        &self,
        machine: &Machine,
        (h, theta): (T, T),
        mut add: impl FnMut(usize, T),
    ) {
        for j in 0..machine.n_joints() {
            if self.is_implicit[j] {
                let joint = &self.joints[j];
                let damping = joint.active + joint.damping;
                let implicit = h * joint.theta * (damping + h * theta * joint.stiffness);
                add(j + 1, implicit);
            }
        }
    }

    /// `out += h τ`, with the torques extrapolated from the start of the step.
    #[inline(always)]
    pub fn add_impulse(&self, machine: &Machine, h: T, places: &[T], v: &[T], out: &mut [T]) {
        for j in 0..machine.n_joints() {
            let k = velocity(j + 1);
            let joint = &self.joints[j];
            let mut torque = joint.torque + joint.at_rest;
            if self.is_implicit[j] {
                torque -= joint.active * v[k];
                let place = places[j] + h * joint.theta * v[k];
                torque -= joint.stiffness * (place - joint.set_point) + joint.damping * v[k];
            }
            out[k] += h * torque;
        }
    }

    /// Work of all joints over a step from `v` to `v_end`, J; keeps impulse and work of each drive.
    /// The mask is true where a motor has left its branch.
    #[inline(always)]
    pub fn work(
        &mut self,
        machine: &Machine,
        (h, theta): (T, T),
        places: &[T],
        v: &[T],
        v_end: &[T],
    ) -> (T, T::Mask) {
        let zero = h.like(0.0);
        let mut total = zero;
        let mut has_left = zero.lt(zero);
        for j in 0..machine.n_joints() {
            let k = velocity(j + 1);
            let joint = &self.joints[j];
            let mean = theta * v_end[k] + (h.like(1.0) - theta) * v[k];
            let turned = h * mean;
            let mut drive = joint.at_rest;
            let (mut other, mut damper) = (joint.torque, zero);
            if self.is_implicit[j] {
                let rate = v[k] + joint.theta * (v_end[k] - v[k]);
                drive = joint.at_rest - joint.active * rate;
                let place = places[j] + h * joint.theta * mean;
                other -= joint.stiffness * (place - joint.set_point);
                damper = -joint.damping * rate;
                let (at_rest, active) = joint.branch(rate);
                has_left = has_left | !at_rest.le(joint.at_rest) | !joint.at_rest.le(at_rest);
                has_left = has_left | !active.le(joint.active) | !joint.active.le(active);
            }
            // A line only reduces the power of the command.
            let work = (drive * turned).min(joint.command * turned);
            self.tried[j] = [drive * h, work];
            total += work + other * turned + (damper * turned).min(zero);
        }
        (total, has_left)
    }

    /// Work of all joints over a displacement that is added to such a step, J.
    #[inline(always)]
    pub fn work_of_displacement(
        &self,
        machine: &Machine,
        (h, theta): (T, T),
        places: &[T],
        [v, v_end, displacement]: [&[T]; 3],
    ) -> T {
        let mut total = h.like(0.0);
        for j in 0..machine.n_joints() {
            let k = velocity(j + 1);
            let joint = &self.joints[j];
            let (mut drive, mut other) = (joint.at_rest, joint.torque);
            if self.is_implicit[j] {
                let mean = theta * v_end[k] + (h.like(1.0) - theta) * v[k];
                let rate = v[k] + joint.theta * (v_end[k] - v[k]);
                drive = joint.at_rest - joint.active * rate;
                let place = places[j] + h * joint.theta * mean;
                other -= joint.stiffness * (place - joint.set_point);
            }
            total += (drive + other) * displacement[k];
        }
        total
    }
}

impl<T: Lane> Joint<T> {
    /// Branch at a rate: torque `at_rest − slope ω`.
    #[inline(always)]
    fn branch(&self, rate: T) -> (T, T) {
        let zero = rate.like(0.0);
        let drop = self.slope * rate;
        let (upper, lower) = (self.stall - drop, -self.stall - drop);
        let [ahead, back] = self.beyond;
        let is_above = upper.lt(self.command);
        let is_below = self.command.lt(lower);
        let is_far_above = is_above & upper.lt(-back);
        let is_far_below = is_below & ahead.lt(lower);
        let mut at_rest = T::select(is_above, self.stall, self.command);
        at_rest = T::select(is_far_above, -back, at_rest);
        at_rest = T::select(is_below, -self.stall, at_rest);
        at_rest = T::select(is_far_below, ahead, at_rest);
        let is_on_line = (is_above & !is_far_above) | (is_below & !is_far_below);
        (at_rest, T::select(is_on_line, self.slope, zero))
    }
}

/// [`crate::system::fitted_theta`] in every lane.
#[inline(always)]
fn fitted_theta<T: Lane>(z: T) -> T {
    let one = z.like(1.0);
    let series = z.like(0.5) + z / z.like(12.0) - z * z * z / z.like(720.0);
    let exact = one / -exp_m1(-z) - one / z;
    T::select(z.lt(z.like(1e-2)), series, exact)
}
