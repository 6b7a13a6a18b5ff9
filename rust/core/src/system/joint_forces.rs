//! Forces of the joints in a step: drives, position control, springs and dampers.
//!
//! The PD control of a held joint is implicit with an exponentially fitted θ_j
//! ([`super::fitted_theta`]), so it is stable for every gain and step size. Springs, dampers and
//! motors on their torque–speed lines are treated in the same way:
//!
//! ```text
//! M̂ = M + h θ_j K_d + h² θ_j θ K_p        on the diagonal
//! ```

use super::command::{Command, HeldJoint};
use super::motor_branch::{MotorBranch, line_slope};
use crate::integrator::{Start, StepOptions};
use crate::multibody::{Configuration, JointProperties, MassMatrix, Model, Passive};

/// Impulse and work of a joint's drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveAction {
    /// Time integral of its torque, N m s.
    pub impulse: f64,
    /// Work, J.
    pub work: f64,
}

/// Branches of the motors, and what the drives have done.
#[derive(Clone, Debug)]
pub(super) struct JointForces {
    motors: Vec<MotorBranch>,
    tried: Vec<DriveAction>,
    /// Impulse and work of each joint's drive since [`Self::begin_step`] (n_joints).
    pub(super) drives: Vec<DriveAction>,
}

impl JointForces {
    /// For n joints.
    pub(super) fn new(n: usize) -> Self {
        Self {
            motors: vec![MotorBranch::default(); n],
            tried: vec![DriveAction::default(); n],
            drives: vec![DriveAction::default(); n],
        }
    }

    /// Resets the impulse and work of the drives.
    pub(super) fn begin_step(&mut self) {
        self.drives.fill(DriveAction::default());
    }

    /// Chooses the motors' branches for a step that begins at the velocity `v`.
    #[inline]
    pub(super) fn choose(&mut self, model: &Model, command: &Command, v: &[f64]) {
        let drives = self.motors.iter_mut().zip(&command.drives);
        for ((motor, drive), &k) in drives.zip(model.joint_velocities()) {
            motor.choose(drive.as_ref(), v[k]);
        }
    }

    /// Moves towards the branches of a step between two velocities; whether one changed.
    pub(super) fn revise(
        &mut self,
        model: &Model,
        command: &Command,
        (v, v_end): (&[f64], &[f64]),
    ) -> bool {
        let drives = self.motors.iter_mut().zip(&command.drives);
        let mut is_new = false;
        for ((motor, drive), &k) in drives.zip(model.joint_velocities()) {
            is_new |= motor.revise(drive.as_ref(), v[k], v_end[k]);
        }
        is_new
    }

    /// Sets the implicit weights of each joint's PD control and motor.
    pub(super) fn set_theta(
        &mut self,
        model: &Model,
        options: &StepOptions,
        command: &Command,
        mass_matrix: &MassMatrix<f64>,
    ) {
        let joints = (self.motors.iter_mut().zip(&command.held)).zip(&command.drives);
        for (((motor, held), drive), joint) in joints.zip(model.joints()) {
            let inertia = mass_matrix.diagonal(model.mechanism(), joint.velocity);
            let feedback = feedback(line_slope(drive.as_ref()), held.as_ref(), &joint.passive);
            motor.set_theta((options.time_step, options.theta), feedback, inertia);
        }
    }

    /// Adds what is implicit to the mass matrix.
    #[inline]
    pub(super) fn add_to_mass(
        &self,
        model: &Model,
        options: &StepOptions,
        command: &Command,
        mass_matrix: &mut MassMatrix<f64>,
    ) {
        let (h, theta) = (options.time_step, options.theta);
        let joints = self.motors.iter().zip(&command.held);
        for ((motor, held), joint) in joints.zip(model.joints()) {
            let (damping, stiffness) = feedback(motor.damping(), held.as_ref(), &joint.passive);
            if damping > 0.0 || stiffness > 0.0 {
                let implicit = h * motor.theta() * (damping + h * theta * stiffness);
                mass_matrix.add_to_diagonal(model.mechanism(), joint.velocity, implicit);
            }
        }
    }

    /// Adds `h τ` of a trial step to `y`.
    #[inline]
    pub(super) fn add_impulse(&self, model: &Model, trial: Trial<'_>, y: &mut [f64]) {
        let h = trial.options.time_step;
        trial.for_each(model, &self.motors, |joint, torque| {
            y[joint.velocity] += h * (torque.other + torque.damper + torque.drive);
        });
    }

    /// Work of a trial step, J; notes that of the drives.
    pub(super) fn work(&mut self, model: &Model, trial: Trial<'_>) -> f64 {
        let h = trial.options.time_step;
        let mut total = 0.0;
        let mut drives = trial.command.drives.iter().zip(&mut self.tried);
        trial.for_each(model, &self.motors, |joint, torque| {
            let turned = h * trial.mean_rate(joint.velocity);
            if let Some((drive, tried)) = drives.next() {
                let work = MotorBranch::work(drive.as_ref(), torque.drive, turned);
                *tried = DriveAction {
                    impulse: torque.drive * h,
                    work,
                };
                // A damper only dissipates. In a step that reverses the rate, torque and
                // displacement are evaluated at different times, and their product may be positive.
                total += work + torque.other * turned + (torque.damper * turned).min(0.0);
            }
        });
        total
    }

    /// Work of a trial step's torques, without the dampers', over a displacement (nv), J.
    pub(super) fn work_of_displacement(
        &self,
        model: &Model,
        trial: Trial<'_>,
        displacement: &[f64],
    ) -> f64 {
        let mut total = 0.0;
        trial.for_each(model, &self.motors, |joint, torque| {
            total += (torque.drive + torque.other) * displacement[joint.velocity];
        });
        total
    }

    /// Counts the last trial step.
    #[inline]
    pub(super) fn accept(&mut self) {
        for (done, tried) in self.drives.iter_mut().zip(&self.tried) {
            done.impulse += tried.impulse;
            done.work += tried.work;
        }
    }
}

/// Effective damping (N m s/rad) and stiffness (N m/rad) of a joint's torque: those of its motor,
/// of its position control, and of its own damper and spring.
#[inline]
fn feedback(motor: f64, held: Option<&HeldJoint>, passive: &Passive) -> (f64, f64) {
    let (mut damping, mut stiffness) = (motor + passive.damping, passive.stiffness);
    if let Some(held) = held {
        damping += held.damping;
        stiffness += held.stiffness;
    }
    (damping, stiffness)
}

/// Mean torque of a joint over the step, N m.
struct Actuation {
    /// Torque of its drive.
    drive: f64,
    /// Torque of its dampers.
    damper: f64,
    /// All other torques.
    other: f64,
}

/// A trial step: its command, its start, and the velocity at its end.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    pub(super) options: &'a StepOptions,
    pub(super) command: &'a Command,
    pub(super) start: Start<'a, Configuration>,
    pub(super) v_end: &'a [f64],
}

impl Trial<'_> {
    /// Mean velocity over the step, rad/s or m/s.
    #[inline]
    fn mean_rate(&self, k: usize) -> f64 {
        let theta = self.options.theta;
        theta * self.v_end[k] + (1.0 - theta) * self.start.v[k]
    }

    /// Torques of every joint. PD control, spring and motor line are evaluated at the θ_j-weighted
    /// position and velocity of the iterate.
    #[inline]
    fn for_each(
        &self,
        model: &Model,
        motors: &[MotorBranch],
        mut act: impl FnMut(&JointProperties, Actuation),
    ) {
        let h = self.options.time_step;
        let acting = self.command.torque.iter().zip(&self.command.held);
        let joints = model.joints().iter().zip(motors);
        let places = &self.start.configuration.joints;
        for (((joint, motor), (torque, held)), q) in joints.zip(acting).zip(places) {
            let k = joint.velocity;
            let (mut other, mut damper) = (*torque, 0.0);
            if held.is_some() || joint.is_passive {
                let place = q + h * motor.theta() * self.mean_rate(k);
                let (spring, brake) = answer(held.as_ref(), &joint.passive, place);
                other -= spring;
                damper = -brake * motor.rate(self.start.v[k], self.v_end[k]);
            }
            let actuation = Actuation {
                drive: motor.torque(|| (self.start.v[k], self.v_end[k])),
                damper,
                other,
            };
            act(joint, actuation);
        }
    }
}

/// Spring torque (N m) at a coordinate, and damping (N m s/rad), of the position control and of the
/// joint's own elements.
#[inline]
fn answer(held: Option<&HeldJoint>, passive: &Passive, place: f64) -> (f64, f64) {
    let own = passive.stiffness * (place - passive.rest);
    match held {
        Some(held) => {
            let spring = held.stiffness * (place - held.set_point);
            (spring + own, held.damping + passive.damping)
        }
        None => (own, passive.damping),
    }
}
