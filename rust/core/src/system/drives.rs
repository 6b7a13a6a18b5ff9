//! Torques, motors, servos, held joints, springs and dampers of machines side by side.
//!
//! Position control, springs, dampers, servos and the motors' torque–speed lines are implicit with
//! an exponentially fitted θ_j ([`super::fitted_theta`]):
//!
//! ```text
//! τ = −K (q + h θ_j v_mean − q_set) − D ω + at_rest − active (ω − centre)
//! ω = v + θ_j (v⁺ − v)
//! M̂ = M + h θ_j (D + active + h θ K)
//! ```
//!
//! The branch of a motor or a servo is chosen at ω, so that torque, branch and work are consistent.
//! A step that leaves a branch is repeated with the next one ([`Drives::revise`]). Torques never
//! rise with the speed, so the implicit term is dissipative.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::command::Command;
use super::fitted_theta::implicit_weight;
use crate::integrator::Work;
use crate::multibody::mechanism::Mechanism;
use crate::multibody::{JointProperties, MotorLine, Passive};
use crate::scalar::{Lane, LaneMask};

/// Command of one joint in every lane, and its motor in the present step.
#[derive(Clone, Copy, Debug)]
struct Joint<T> {
    /// Torque apart from the drive's, N m.
    torque: T,
    /// Torque–speed line and command of the joint's drive.
    line: MotorLine<T>,
    /// Position control, spring and damper: stiffness and damping of all together, and where their
    /// torque is zero; 0 where the joint is free.
    stiffness: T,
    damping: T,
    set_point: T,
    /// Implicit weight θ_j.
    theta: T,
}

/// Mean torques of a joint over a step, N m, and the angle by which it turns.
#[derive(Clone, Copy, Debug)]
struct Actuation<T> {
    drive: T,
    damper: T,
    spring: T,
    /// All other torques.
    other: T,
    turned: T,
}

/// Commands of all joints, a machine a lane.
#[derive(Clone, Debug)]
pub struct Drives<T> {
    joints: Vec<Joint<T>>,
    /// Joints that have implicit terms in some lane.
    is_implicit: Vec<bool>,
    /// Joints that have a motor or a servo in some lane.
    motors: Vec<usize>,
    /// Impulse (N m s) and work (J) of each joint's drive in the step being tried.
    tried: Vec<[T; 2]>,
    /// Impulse of each joint's drive in the last step, and work since the call began.
    done: Vec<[T; 2]>,
}

impl<T: Lane> Drives<T> {
    /// No torque, nothing held.
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let (n, zero) = (mechanism.n_joints(), T::splat(token, 0.0));
        let joint = Joint {
            torque: zero,
            line: MotorLine::new(token),
            stiffness: zero,
            damping: zero,
            set_point: zero,
            theta: T::splat(token, 0.5),
        };
        Self {
            joints: vec![joint; n],
            is_implicit: vec![false; n],
            motors: Vec::with_capacity(n),
            tried: vec![[zero; 2]; n],
            done: vec![[zero; 2]; n],
        }
    }

    /// Sets the command of a lane whose machine has these `joints`. [`Self::finish_loading`]
    /// follows after all lanes.
    pub fn set_lane(&mut self, lane: usize, joints: &[JointProperties], command: &Command) {
        let drives = command.drives.iter().zip(&command.held);
        let commands = command.torque.iter().zip(drives);
        for ((own, joint), (torque, (drive, held))) in
            self.joints.iter_mut().zip(joints).zip(commands)
        {
            let motor = drive.as_ref().and_then(|drive| drive.motor.as_ref());
            let asked = drive.map_or(0.0, |drive| drive.torque);
            let servo = drive.as_ref().and_then(|drive| drive.servo.as_ref());
            own.line.set_lane(lane, motor, asked, servo);
            // No negative zeros, as there.
            own.torque.set(lane, *torque + 0.0);
            let (stiffness, damping, set_point) =
                held.map_or((0.0, 0.0, 0.0), |h| (h.stiffness, h.damping, h.set_point));
            own.stiffness.set(lane, stiffness);
            own.damping.set(lane, damping);
            own.set_point.set(lane, set_point);
            if joint.is_passive {
                own.add_passive(lane, &joint.passive);
            }
        }
    }

    /// Adds to the command of a joint's drive, N m, or to the speed of its servo, rad/s.
    #[inline(always)]
    pub fn add_command(&mut self, joint: usize, change: T) {
        self.joints[joint].line.add_command(change);
    }

    /// Adds to the set-point of a joint's position control, rad or m, of which that control has the
    /// `share` of the whole stiffness.
    #[inline(always)]
    pub fn add_set_point(&mut self, joint: usize, share: T, change: T) {
        self.joints[joint].set_point += share * change;
    }

    /// Stiffness of a joint in all, N m/rad or N/m.
    #[inline(always)]
    #[must_use]
    pub fn stiffness(&self, joint: usize) -> T {
        self.joints[joint].stiffness
    }

    /// Adds to the damping of a joint, N m s/rad or N s/m.
    #[inline(always)]
    pub fn add_damping(&mut self, joint: usize, change: T) {
        self.joints[joint].damping += change;
        self.is_implicit[joint] = true;
    }

    /// Notes which joints need implicit terms, and which have motors.
    pub fn finish_loading(&mut self) {
        self.motors.clear();
        for (j, (is_implicit, joint)) in (self.is_implicit.iter_mut().zip(&self.joints)).enumerate()
        {
            if joint.line.has_branches() {
                self.motors.push(j);
            }
            let slope = joint.line.slope();
            let zero = slope.like(0.0);
            *is_implicit =
                (zero.lt(slope) | zero.lt(joint.damping) | zero.lt(joint.stiffness)).any();
        }
    }

    /// Sets the work of a lane's drives since the call began (n_joints), J.
    pub fn set_work(&mut self, lane: usize, work: &[f64]) {
        for (done, work) in self.done.iter_mut().zip(work) {
            done[1].set(lane, *work);
        }
    }

    /// Writes it.
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

    /// Forgets the impulses of the last step, whose parts [`Self::accept_part`] adds up.
    pub fn begin_step(&mut self) {
        for done in &mut self.done {
            done[0] = done[0].like(0.0);
        }
    }

    /// The step whose work was last requested becomes the last one, in the lanes of a mask.
    #[inline(always)]
    pub fn accept(&mut self, lanes: T::Mask) {
        for (done, tried) in self.done.iter_mut().zip(&self.tried) {
            done[0] = T::select(lanes, tried[0], done[0]);
            done[1] = T::select(lanes, done[1] + tried[1], done[1]);
        }
    }

    /// Adds the impulses and work of the part of a step that was tried last, in some lanes.
    pub fn accept_part(&mut self, lanes: T::Mask) {
        let done = self.done.iter_mut().flatten();
        for (done, tried) in done.zip(self.tried.as_flattened()) {
            *done = T::select(lanes, *done + *tried, *done);
        }
    }

    /// Whether any joint has a motor or a servo.
    #[inline]
    #[must_use]
    pub fn has_motors(&self) -> bool {
        !self.motors.is_empty()
    }

    /// Chooses each motor's branch for the rates at the start of a step.
    #[inline(always)]
    pub fn choose_branches(&mut self, mechanism: &Mechanism, v: &[T]) {
        for &j in &self.motors {
            self.joints[j].line.choose(v[mechanism.joints[j].velocity]);
        }
    }

    /// Chooses θ_j, and limits the gains of servos, for the `inertia` of each joint's velocity
    /// (diagonal of M), kg m².
    #[inline(always)]
    pub fn set_theta(
        &mut self,
        mechanism: &Mechanism,
        (h, theta): (T, T),
        inertia: impl Fn(usize) -> T,
    ) {
        for ((j, own), joint) in mechanism.joints.iter().enumerate().zip(&mut self.joints) {
            joint.theta = theta;
            if self.is_implicit[j] {
                let inertia = inertia(own.velocity);
                joint.line.limit_gain(h, inertia);
                let feedback = (joint.line.slope() + joint.damping, joint.stiffness);
                joint.theta = implicit_weight((h, theta), feedback, inertia);
            }
        }
    }

    /// Moves each motor in the lanes of a mask one branch towards that of a step that ends with
    /// `v_end`. Returns the lanes in which a torque changed.
    #[inline(always)]
    pub fn revise(
        &mut self,
        mechanism: &Mechanism,
        lanes: T::Mask,
        v: &[T],
        v_end: &[T],
    ) -> T::Mask {
        let mut changed = lanes & !lanes;
        for &j in &self.motors {
            let k = mechanism.joints[j].velocity;
            let joint = &mut self.joints[j];
            changed = changed | joint.line.revise(lanes, joint.rate(v[k], v_end[k]));
        }
        changed
    }

    /// Calls `add(k, a)` with the implicit term a of every joint velocity k that has one.
    #[inline(always)]
    pub fn add_implicit(
        &self,
        mechanism: &Mechanism,
        (h, theta): (T, T),
        mut add: impl FnMut(usize, T),
    ) {
        for (j, joint) in self.joints.iter().enumerate() {
            if self.is_implicit[j] {
                let damping = joint.line.damping() + joint.damping;
                let implicit = h * joint.theta * (damping + h * theta * joint.stiffness);
                add(mechanism.joints[j].velocity, implicit);
            }
        }
    }

    /// `out += h τ` for a step that ends with the iterate `v_end`. `places`: joint coordinates at
    /// its start.
    #[inline(always)]
    pub fn add_impulse(
        &self,
        mechanism: &Mechanism,
        step: (T, T),
        places: &[T],
        [v, v_end]: [&[T]; 2],
        out: &mut [T],
    ) {
        for (j, own) in mechanism.joints.iter().enumerate() {
            let k = own.velocity;
            let torque = self.actuation(j, step, places[j], [v[k], v_end[k]]);
            out[k] += step.0 * (torque.other + torque.spring + torque.drive + torque.damper);
        }
    }

    /// Work of the joints of each cluster over a step from `v` to `v_end`; keeps impulse and work
    /// of each drive.
    #[inline(always)]
    pub fn work(
        &mut self,
        mechanism: &Mechanism,
        step: (T, T),
        places: &[T],
        [v, v_end]: [&[T]; 2],
        out: &mut [Work<T>],
    ) {
        let zero = step.0.like(0.0);
        out.fill(Work::none(zero));
        for (j, own) in mechanism.joints.iter().enumerate() {
            let k = own.velocity;
            let torque = self.actuation(j, step, places[j], [v[k], v_end[k]]);
            let turned = torque.turned;
            let work = self.joints[j].line.work(torque.drive, turned);
            self.tried[j] = [torque.drive * step.0, work];
            // A damper only dissipates. In a step that reverses the rate, torque and displacement
            // are evaluated at different times, and their product may be positive.
            let total = &mut out[own.cluster];
            total.supplied += work + torque.other * turned;
            total.damped += (-torque.damper * turned).max(zero);
            total.of_springs += torque.spring * turned;
        }
    }

    /// Energy that springs and position controls of each cluster store at joint coordinates, J, but
    /// for a constant where a joint has both. `zero`: 0 in every lane.
    #[inline(always)]
    pub fn stored(&self, mechanism: &Mechanism, zero: T, places: &[T], out: &mut [T]) {
        out.fill(zero);
        let joints = self.joints.iter().zip(&mechanism.joints);
        for ((joint, own), (place, is_implicit)) in joints.zip(places.iter().zip(&self.is_implicit))
        {
            if *is_implicit {
                let stretch = *place - joint.set_point;
                out[own.cluster] += joint.stiffness * stretch * stretch;
            }
        }
        for twice in out {
            *twice = zero.like(0.5) * *twice;
        }
    }

    /// Work that drives and torques supply over a displacement that is added to such a step, J.
    #[inline(always)]
    pub fn work_of_displacement(
        &self,
        mechanism: &Mechanism,
        step: (T, T),
        places: &[T],
        [v, v_end, displacement]: [&[T]; 3],
    ) -> T {
        let mut total = step.0.like(0.0);
        for (j, own) in mechanism.joints.iter().enumerate() {
            let k = own.velocity;
            let torque = self.actuation(j, step, places[j], [v[k], v_end[k]]);
            total += (torque.drive + torque.other) * displacement[k];
        }
        total
    }

    /// Torques of a joint in a step between two velocities.
    #[inline(always)]
    fn actuation(
        &self,
        j: usize,
        (h, theta): (T, T),
        place: T,
        [v, v_end]: [T; 2],
    ) -> Actuation<T> {
        let joint = &self.joints[j];
        let mean = theta * v_end + (h.like(1.0) - theta) * v;
        let mut own = Actuation {
            drive: joint.line.at_rest(),
            damper: h.like(0.0),
            spring: h.like(0.0),
            other: joint.torque,
            turned: h * mean,
        };
        if self.is_implicit[j] {
            let rate = joint.rate(v, v_end);
            let place = place + h * joint.theta * mean;
            own.drive = joint.line.torque(rate);
            own.spring = -joint.stiffness * (place - joint.set_point);
            own.damper = -joint.damping * rate;
        }
        own
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
            friction: 0.0,
        };
        let both = held.with(passive);
        self.damping.set(lane, both.damping);
        if passive.stiffness > 0.0 {
            self.stiffness.set(lane, both.stiffness);
            self.set_point.set(lane, both.rest);
        }
    }

    /// Rate at which a step between two rates evaluates implicit terms.
    #[inline(always)]
    fn rate(&self, begin: T, end: T) -> T {
        begin + self.theta * (end - begin)
    }
}
