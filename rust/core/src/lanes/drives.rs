//! Torques, motors, held joints, springs and dampers of the rovers of a block.
//!
//! The formulas are those of [`crate::system`]: position control, springs, dampers and the motors'
//! torque–speed lines are implicit with an exponentially fitted θ_j. A step in which a motor leaves
//! its branch is repeated with the next one ([`Drives::revise`]).

use super::machine::Machine;
use crate::multibody::{Motor, Passive};
use crate::scalar::{Lane, LaneMask};
use crate::system::Command;
use crate::system::fitted_theta::fitted_theta;

/// The branch on which the torque is the command.
const COMMAND: f64 = 2.0;

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
    /// Position control, spring and damper: stiffness and damping of all together, and where their
    /// torque is zero; 0 where the joint is free.
    stiffness: T,
    damping: T,
    set_point: T,
    /// Present branch, from 0 to 4 in the order of the rate ([`Motor`]): torque
    /// `at_rest − active ω`.
    branch: T,
    at_rest: T,
    active: T,
    /// Implicit weight θ_j.
    theta: T,
}

/// Commands of all joints of a block.
#[derive(Clone, Debug)]
pub struct Drives<T> {
    joints: Vec<Joint<T>>,
    /// Joints that have implicit terms in some lane.
    is_implicit: Vec<bool>,
    /// Joints that have a motor in some lane.
    motors: Vec<usize>,
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
            branch: T::splat(token, COMMAND),
            at_rest: zero,
            active: zero,
            theta: T::splat(token, 0.5),
        };
        Self {
            joints: vec![joint; machine.n_joints()],
            is_implicit: vec![false; machine.n_joints()],
            motors: Vec::with_capacity(machine.n_joints()),
            tried: vec![[zero; 2]; machine.n_joints()],
            done: vec![[zero; 2]; machine.n_joints()],
        }
    }

    /// Sets the command of a lane, and the work of each drive since the call began (n_joints), J.
    /// [`Self::finish_loading`] follows after all lanes. `passive`: spring and damper of a joint of
    /// the machine that has one.
    pub fn set_lane(
        &mut self,
        lane: usize,
        machine: &Machine,
        command: &Command,
        passive: impl Fn(usize) -> Passive,
        work: &[f64],
    ) {
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
        for &j in &machine.passive {
            self.joints[j].add_passive(lane, &passive(j));
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

    /// Notes which joints need implicit terms, and which have motors.
    pub fn finish_loading(&mut self) {
        self.motors.clear();
        for (j, (is_implicit, joint)) in (self.is_implicit.iter_mut().zip(&self.joints)).enumerate()
        {
            let zero = joint.slope.like(0.0);
            if joint.stall.lt(zero.like(f64::INFINITY)).any() {
                self.motors.push(j);
            }
            *is_implicit =
                (zero.lt(joint.slope) | zero.lt(joint.damping) | zero.lt(joint.stiffness)).any();
        }
    }

    /// Whether any joint has a motor.
    #[inline]
    #[must_use]
    pub fn has_motors(&self) -> bool {
        !self.motors.is_empty()
    }

    /// Chooses each motor's branch for the rates at the start of the step, and θ_j for the
    /// `inertia` of each joint's velocity (diagonal of M), kg m².
    #[inline(always)]
    pub fn choose(
        &mut self,
        machine: &Machine,
        (h, theta): (T, T),
        v: &[T],
        inertia: impl Fn(usize) -> T,
    ) {
        for ((j, own), joint) in machine.joints.iter().enumerate().zip(&mut self.joints) {
            let k = own.velocity;
            (joint.at_rest, joint.active) = (joint.command, theta.like(0.0));
            joint.theta = theta;
            if self.is_implicit[j] {
                let (damping, stiffness) = (joint.slope + joint.damping, joint.stiffness);
                let zero = damping.like(0.0);
                let z = h * (damping + damping.like(0.5) * h * stiffness) / inertia(k);
                let is_stiff = zero.lt(damping) | zero.lt(stiffness);
                joint.theta = T::select(is_stiff, fitted_theta(z).max(theta), theta);
            }
        }
        for &j in &self.motors {
            let joint = &mut self.joints[j];
            let branch = joint.branch_at(v[machine.joints[j].velocity]);
            joint.take(branch);
        }
    }

    /// Moves each motor in the lanes of a mask one branch towards that of a step that ends with
    /// `v_end`. Returns the lanes in which a torque changed.
    #[inline(always)]
    pub fn revise(&mut self, machine: &Machine, lanes: T::Mask, v: &[T], v_end: &[T]) -> T::Mask {
        let mut changed = lanes & !lanes;
        for &j in &self.motors {
            let k = machine.joints[j].velocity;
            let joint = &mut self.joints[j];
            let one = v[k].like(1.0);
            let wanted = joint.branch_at(v[k] + joint.theta * (v_end[k] - v[k]));
            let wanted = wanted.max(joint.branch - one).min(joint.branch + one);
            let (before, slope) = (joint.at_rest, joint.active);
            joint.take(T::select(lanes, wanted, joint.branch));
            let is_same = before.le(joint.at_rest)
                & joint.at_rest.le(before)
                & slope.le(joint.active)
                & joint.active.le(slope);
            changed = changed | (lanes & !is_same);
        }
        changed
    }

    /// Calls `add(k, a)` with the implicit term a of every joint velocity k that has one.
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
                add(machine.joints[j].velocity, implicit);
            }
        }
    }

    /// `out += h τ`, with the torques extrapolated from the start of the step.
    #[inline(always)]
    pub fn add_impulse(&self, machine: &Machine, h: T, places: &[T], v: &[T], out: &mut [T]) {
        for ((j, own), joint) in machine.joints.iter().enumerate().zip(&self.joints) {
            let k = own.velocity;
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
    #[inline(always)]
    pub fn work(
        &mut self,
        machine: &Machine,
        (h, theta): (T, T),
        places: &[T],
        v: &[T],
        v_end: &[T],
    ) -> T {
        let zero = h.like(0.0);
        let mut total = zero;
        for ((j, own), joint) in machine.joints.iter().enumerate().zip(&self.joints) {
            let k = own.velocity;
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
            }
            // A line only reduces the power of the command.
            let work = (drive * turned).min(joint.command * turned);
            self.tried[j] = [drive * h, work];
            total += work + other * turned + (damper * turned).min(zero);
        }
        total
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
        for ((j, own), joint) in machine.joints.iter().enumerate().zip(&self.joints) {
            let k = own.velocity;
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
    /// Adds a spring and a damper to the position control of a lane.
    fn add_passive(&mut self, lane: usize, passive: &Passive) {
        let held = Passive {
            stiffness: self.stiffness.get(lane),
            rest: self.set_point.get(lane),
            damping: self.damping.get(lane),
            armature: 0.0,
        };
        let both = held.with(passive);
        self.damping.set(lane, both.damping);
        if passive.stiffness > 0.0 {
            self.stiffness.set(lane, both.stiffness);
            self.set_point.set(lane, both.rest);
        }
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
        T::select(is_below & ahead.lt(lower), number(COMMAND - 2.0), branch)
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
    }
}
