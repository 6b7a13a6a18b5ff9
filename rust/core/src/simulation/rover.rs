//! The simulation: one machine, one terrain, one state.

use std::sync::Arc;

use nalgebra::Vector3;

use super::error::{CommandError, SnapshotError};
use super::profile::Stopwatch;
use super::snapshot::Snapshot;
use crate::contact::{
    Activation, Contact, ContactFrame, Opposite, OtherSide, Part, detect, detection::wheel_contacts,
};
use crate::geometry::Terrain;
use crate::integrator::{
    Integrator, NoProbe, OptionsError, Probe, StateMut, StepError, StepOptions, StepReport,
    WarmStart,
};
use crate::multibody::{Configuration, Energy, Kinematics, Model, Momentum, State, momentum};
use crate::system::{
    ActiveContact, Command, Drive, HeldJoint, TreeSystem, Workspace,
    tree_workspace::contact_capacity,
};

/// How far the squared length of a snapshot's quaternion may be from 1: the steps keep it within rounding.
const UNIT: f64 = 1e-12;

/// A machine on a terrain. Model and terrain are shared; everything else is its own.
#[derive(Clone)]
pub struct Simulation {
    model: Arc<Model>,
    terrain: Arc<dyn Terrain>,
    options: StepOptions,
    state: State,
    command: Command,
    wheel_torque: Vec<f64>,
    joint_torque: Vec<f64>,
    motor_torque: Vec<f64>,
    drive_work: Vec<f64>,
    warm_start: WarmStart,
    workspace: Workspace,
    active: Vec<ActiveContact>,
    last_call: LastCall,
}

/// What the last call of [`Simulation::step`] came to; not part of the state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastCall {
    /// Report of its steps; empty where one could not be taken.
    pub report: StepReport,
    /// Work through the wheel motors, Σ |∫ τ_i dφ_i|, driving or braking, J.
    pub work: f64,
    /// Its driving part, Σ max(∫ τ_i dφ_i, 0), J.
    pub positive_work: f64,
}

impl Simulation {
    /// At rest in the zero configuration; steering joints held at zero, all others free.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        model: Arc<Model>,
        terrain: Arc<dyn Terrain>,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        options.check()?;
        let mut command = Command::idle(&model);
        for wheel in model.wheels() {
            if let Some(j) = wheel.joint {
                command.drives[j] = Some(Drive {
                    torque: 0.0,
                    motor: wheel.motor,
                });
            }
            if let Some(j) = wheel.steering {
                let hold = model.hold(j);
                command.held[j] = Some(HeldJoint {
                    set_point: 0.0,
                    stiffness: hold.stiffness,
                    damping: hold.damping,
                });
            }
        }
        Ok(Self {
            state: State::zero(&model),
            wheel_torque: vec![0.0; model.wheels().len()],
            joint_torque: vec![0.0; model.n_joints()],
            motor_torque: vec![0.0; model.wheels().len()],
            drive_work: vec![0.0; model.n_joints()],
            warm_start: WarmStart::with_capacity(contact_capacity(&model), model.nv()),
            workspace: Workspace::new(&model),
            active: Vec::with_capacity(contact_capacity(&model)),
            last_call: LastCall::default(),
            command,
            model,
            terrain,
            options,
        })
    }

    /// The machine.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The ground.
    #[must_use]
    pub fn terrain(&self) -> &Arc<dyn Terrain> {
        &self.terrain
    }

    /// Options of every step.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// Where it is and how fast.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Torques and held joints.
    #[must_use]
    pub fn command(&self) -> &Command {
        &self.command
    }

    /// Contacts of the last step.
    #[must_use]
    pub fn contacts(&self) -> &[ActiveContact] {
        &self.active
    }

    /// The last step's friction-contact problem: W (row-major), free velocity, friction.
    #[must_use]
    pub fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        self.workspace.last_problem()
    }

    /// Sets configuration and velocity, as checked by [`crate::multibody::coordinates`]; time 0, warm start forgotten.
    ///
    /// # Panics
    /// If the sizes are another model's.
    pub fn set_state(&mut self, configuration: Configuration, v: Vec<f64>) {
        assert_eq!(
            configuration.joints.len(),
            self.model.n_joints(),
            "invariant: a configuration of this model"
        );
        assert_eq!(
            v.len(),
            self.model.nv(),
            "invariant: a velocity of this model"
        );
        self.state = State {
            configuration,
            v,
            time: 0.0,
        };
        self.warm_start.clear();
        self.active.clear();
        self.motor_torque.fill(0.0);
        self.last_call = LastCall::default();
    }

    /// Commanded driving torque of each wheel, positive forward, within its limit (N m).
    #[must_use]
    pub fn wheel_torques(&self) -> &[f64] {
        &self.wheel_torque
    }

    /// Mean torque that the drive of each wheel gave in the last step, positive forward (N m): the command, within the motor's line.
    ///
    /// Zero before any step and where the wheel is locked.
    #[must_use]
    pub fn motor_torques(&self) -> &[f64] {
        &self.motor_torque
    }

    /// Sets the driving torques (N m, positive forward); each saturates at its wheel's limit.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_wheel_torques(&mut self, torques: &[f64]) -> Result<(), CommandError> {
        check("torques", torques, self.model.wheels().len())?;
        for ((own, torque), wheel) in self
            .wheel_torque
            .iter_mut()
            .zip(torques)
            .zip(self.model.wheels())
        {
            *own = torque.clamp(-wheel.torque_limit, wheel.torque_limit);
        }
        self.combine_torques();
        Ok(())
    }

    /// Sets torques about the joint axes (n_joints, N m) that come on top of the wheels' and have no limit.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_joint_torques(&mut self, torques: &[f64]) -> Result<(), CommandError> {
        check("torques", torques, self.model.n_joints())?;
        self.joint_torque.copy_from_slice(torques);
        self.combine_torques();
        Ok(())
    }

    fn combine_torques(&mut self) {
        self.command.torque.copy_from_slice(&self.joint_torque);
        for drive in self.command.drives.iter_mut().flatten() {
            drive.torque = 0.0;
        }
        for (wheel, torque) in self.model.wheels().iter().zip(&self.wheel_torque) {
            if let Some(drive) = wheel.joint.and_then(|j| self.command.drives[j].as_mut()) {
                drive.torque += wheel.drive_sign * torque;
            }
        }
    }

    /// Steering set-point of each wheel, rad; 0 where its steering is not held or is locked.
    #[must_use]
    pub fn steering(&self) -> Vec<f64> {
        let of = |j: usize| self.command.held[j].map_or(0.0, |h| h.set_point);
        self.model
            .wheels()
            .iter()
            .map(|w| w.steering.map_or(0.0, of))
            .collect()
    }

    /// Holds the steering joints at set-points (rad, one a wheel) with the model's gains.
    ///
    /// # Errors
    /// Wrong length, not finite, beyond the wheel's limit, or nonzero where there is no free steering joint.
    pub fn set_steering(&mut self, set_points: &[f64]) -> Result<(), CommandError> {
        self.check_steering(set_points)?;
        for (&set_point, wheel) in set_points.iter().zip(self.model.wheels()) {
            if let Some(j) = wheel.steering {
                let hold = self.model.hold(j);
                let held = self.command.held[j];
                let (stiffness, damping) =
                    held.map_or((hold.stiffness, hold.damping), |h| (h.stiffness, h.damping));
                self.command.held[j] = Some(HeldJoint {
                    set_point,
                    stiffness,
                    damping,
                });
            }
        }
        Ok(())
    }

    fn check_steering(&self, set_points: &[f64]) -> Result<(), CommandError> {
        check("set_points", set_points, self.model.wheels().len())?;
        for (index, (&value, wheel)) in set_points.iter().zip(self.model.wheels()).enumerate() {
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
        self.check_commands(torques, set_points)?;
        self.set_wheel_torques(torques)?;
        self.set_steering(set_points)
    }

    /// Whether [`Self::set_wheel_torques`] and [`Self::set_steering`] would take these.
    ///
    /// # Errors
    /// As these two.
    pub fn check_commands(&self, torques: &[f64], set_points: &[f64]) -> Result<(), CommandError> {
        check("torques", torques, self.model.wheels().len())?;
        self.check_steering(set_points)
    }

    /// Holds joints by name; set-points default to where they are, gains to the model's.
    ///
    /// # Errors
    /// An unknown joint, a wrong number of set-points, a gain that is negative or not finite; nothing is changed then.
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
        for (i, &j) in indices.iter().enumerate() {
            let hold = self.model.hold(j);
            self.command.held[j] = Some(HeldJoint {
                set_point: set_points.map_or(self.state.configuration.joints[j], |p| p[i]),
                stiffness: stiffness.unwrap_or(hold.stiffness),
                damping: damping.unwrap_or(hold.damping),
            });
        }
        Ok(())
    }

    /// Lets joints go by name.
    ///
    /// # Errors
    /// An unknown joint; nothing is changed then.
    pub fn release(&mut self, joints: &[String]) -> Result<(), CommandError> {
        for j in self.joint_indices(joints)? {
            self.command.held[j] = None;
        }
        Ok(())
    }

    /// Holds all wheels where they are and takes their torques away.
    pub fn brake(&mut self) {
        self.wheel_torque.fill(0.0);
        self.combine_torques();
        for wheel in self.model.wheels() {
            if let Some(j) = wheel.joint {
                let hold = self.model.hold(j);
                let set_point = self.state.configuration.joints[j];
                self.command.held[j] = Some(HeldJoint {
                    set_point,
                    stiffness: hold.stiffness,
                    damping: hold.damping,
                });
            }
        }
    }

    fn joint_indices(&self, joints: &[String]) -> Result<Vec<usize>, CommandError> {
        let index = |name: &String| {
            let found = self.model.joint_index(name);
            found.ok_or_else(|| CommandError::UnknownJoint {
                field: "joints",
                name: name.clone(),
            })
        };
        joints.iter().map(index).collect()
    }

    /// Takes `n` steps, or stops at the first that fails, keeping the state before it.
    ///
    /// # Errors
    /// See [`StepError`]. A solver that did not converge is no error: see the report.
    pub fn step(&mut self, n: usize) -> Result<StepReport, StepError> {
        self.step_while(n, &mut || true)
    }

    /// The same, but stops after a whole step once `go_on`, which is asked after each, says no.
    ///
    /// The report's `steps` says how many were taken.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_while(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<StepReport, StepError> {
        self.drive_work.fill(0.0);
        let result = self.step_probed(n, go_on, &mut NoProbe);
        // A joint's work over the call counts as driving or as braking.
        let work = self.drive_work.iter().map(|joules| joules.abs()).sum();
        let positive_work = (self.drive_work.iter().map(|joules| joules.max(0.0))).sum();
        self.last_call = LastCall {
            report: result.clone().unwrap_or_default(),
            work,
            positive_work,
        };
        result
    }

    /// What the last call of [`Self::step`] came to.
    #[must_use]
    pub fn last_call(&self) -> &LastCall {
        &self.last_call
    }

    fn step_probed(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let mut total = StepReport::default();
        for _ in 0..n {
            self.workspace.tree.begin_step();
            let mut system = TreeSystem {
                model: &self.model,
                terrain: &*self.terrain,
                command: &self.command,
                parts: &mut self.workspace.tree,
            };
            let state = StateMut {
                configuration: &mut self.state.configuration,
                v: &mut self.state.v,
                time: &mut self.state.time,
            };
            let report = self.options.variant.step(
                &mut system,
                &self.options,
                state,
                &mut self.warm_start,
                &mut self.workspace.step,
                probe,
            )?;
            total.merge(&report);
            self.workspace.list_active(&mut self.active);
            self.book_drives();
            if !go_on() {
                break;
            }
        }
        Ok(total)
    }

    /// Torques and work of the drives in the step that has just become the state.
    fn book_drives(&mut self) {
        let drives = self.workspace.tree.drives();
        for (work, drive) in self.drive_work.iter_mut().zip(drives) {
            *work += drive.work;
        }
        for (torque, wheel) in self.motor_torque.iter_mut().zip(self.model.wheels()) {
            let impulse = wheel.joint.map_or(0.0, |j| drives[j].impulse);
            *torque = wheel.drive_sign * impulse / self.options.time_step;
        }
    }

    /// Takes `n` steps of a copy and says where their time went; `go_on` as for [`Self::step_while`].
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn profile(
        &self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Stopwatch, StepError> {
        let mut copy = self.clone();
        copy.step_while(n.min(10), go_on)?;
        let mut stopwatch = Stopwatch::start();
        let report = copy.step_probed(n, go_on, &mut stopwatch)?;
        stopwatch.finish(report.steps);
        Ok(stopwatch)
    }

    /// Poses of the bodies now.
    #[must_use]
    pub fn kinematics(&self) -> Kinematics {
        Kinematics::of(&self.model, &self.state.configuration)
    }

    /// Kinetic and potential energy now, J.
    #[must_use]
    pub fn energy(&self) -> Energy {
        momentum::energy(
            &self.model,
            &self.kinematics(),
            &self.state.v,
            &self.options.gravity,
        )
    }

    /// Linear momentum, and angular momentum about the world's origin.
    #[must_use]
    pub fn momentum(&self) -> Momentum {
        momentum::momentum(&self.model, &self.kinematics(), &self.state.v)
    }

    /// Mass centre, world, m.
    #[must_use]
    pub fn centre_of_mass(&self) -> Vector3<f64> {
        momentum::centre_of_mass(&self.model, &self.kinematics())
    }

    /// Nearest point, frame and gap of every wheel now.
    #[must_use]
    pub fn wheel_contacts(&self) -> Vec<Contact> {
        wheel_contacts(&self.model, &self.kinematics(), &*self.terrain)
    }

    /// Deepest gap (m) of any wheel or box with the ground now: 0 where nothing overlaps, else negative.
    #[must_use]
    pub fn deepest_overlap(&self) -> f64 {
        let mut contacts = Vec::new();
        let (kinematics, at_rest) = (self.kinematics(), vec![0.0; self.model.nv()]);
        let touching = Activation::default();
        detect(
            &self.model,
            &kinematics,
            &kinematics,
            &*self.terrain,
            &at_rest,
            &touching,
            &mut contacts,
        );
        contacts
            .iter()
            .fold(0.0, |deepest, contact| deepest.min(contact.gap))
    }

    /// Mean contact force of the last step on every wheel along its frame's n, t, b, N.
    ///
    /// Several contacts of one wheel are summed in the frame of its first.
    #[must_use]
    pub fn wheel_forces(&self) -> Vec<[f64; 3]> {
        let mut forces = vec![[0.0; 3]; self.model.wheels().len()];
        let mut frames: Vec<Option<ContactFrame>> = vec![None; forces.len()];
        for active in &self.active {
            if let Part::Wheel(i) = active.contact.part {
                let [n, t, b] = active.contact.frame.rows();
                let [p_n, p_t, p_b] = active.impulse;
                let impulse = n * p_n + t * p_t + b * p_b;
                let frame = frames[i].get_or_insert(active.contact.frame);
                for (force, d) in forces[i].iter_mut().zip(frame.rows()) {
                    *force += impulse.dot(&d) / self.options.time_step;
                }
            }
        }
        forces
    }

    /// Mean normal force of the last step on all that is no wheel, N.
    #[must_use]
    pub fn body_force(&self) -> f64 {
        let boxes = self
            .active
            .iter()
            .filter(|a| !matches!(a.contact.part, Part::Wheel(_)));
        boxes.map(|a| a.impulse[0]).sum::<f64>() / self.options.time_step
    }

    /// Everything that is needed to continue bit for bit.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            model: self.model.fingerprint(),
            state: self.state.clone(),
            command: self.command.clone(),
            wheel_torque: self.wheel_torque.clone(),
            joint_torque: self.joint_torque.clone(),
            motor_torque: self.motor_torque.clone(),
            warm_start: self.warm_start.clone(),
            active: self.active.clone(),
        }
    }

    /// Goes back to a snapshot.
    ///
    /// # Errors
    /// A snapshot of another model or with damaged contents; nothing is changed then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        if snapshot.model != self.model.fingerprint() {
            return Err(SnapshotError::OtherModel);
        }
        let expected = self.model.n_joints();
        let command = &snapshot.command;
        let held = command
            .held
            .iter()
            .flatten()
            .flat_map(|h| [h.set_point, h.stiffness, h.damping]);
        // A snapshot's motors are the model's.
        let is_drive = |(theirs, own): (&Option<Drive>, &Option<Drive>)| {
            theirs.is_some() == own.is_some()
                && theirs.is_none_or(|d| d.torque.is_finite())
                && theirs.and_then(|d| d.motor) == own.and_then(|d| d.motor)
        };
        let torques = command
            .torque
            .iter()
            .chain(&snapshot.wheel_torque)
            .chain(&snapshot.joint_torque)
            .chain(&snapshot.motor_torque);
        let attitude = snapshot.state.configuration.attitude.norm_squared();
        let is_sound = snapshot.state.is_finite()
            && (attitude - 1.0).abs() <= UNIT
            && snapshot.state.configuration.joints.len() == expected
            && [&snapshot.wheel_torque, &snapshot.motor_torque]
                .iter()
                .all(|t| t.len() == self.model.wheels().len())
            && snapshot.state.v.len() == self.model.nv()
            && [&command.torque, &snapshot.joint_torque]
                .iter()
                .all(|t| t.len() == expected)
            && command.held.len() == expected
            && command.drives.len() == expected
            && command
                .drives
                .iter()
                .zip(&self.command.drives)
                .all(is_drive)
            && torques.copied().chain(held).all(f64::is_finite)
            && [0, self.model.nv()].contains(&snapshot.warm_start.persistent.len())
            && snapshot.warm_start.persistent.iter().all(|x| x.is_finite())
            && snapshot
                .warm_start
                .impulses
                .iter()
                .all(|(_, p)| p.iter().all(|x| x.is_finite()))
            && snapshot.active.iter().all(|a| is_sound(&self.model, a));
        if !is_sound {
            return Err(SnapshotError::Damaged);
        }
        self.state.clone_from(&snapshot.state);
        self.command.clone_from(&snapshot.command);
        self.wheel_torque.clone_from(&snapshot.wheel_torque);
        self.joint_torque.clone_from(&snapshot.joint_torque);
        self.motor_torque.clone_from(&snapshot.motor_torque);
        self.warm_start.clone_from(&snapshot.warm_start);
        self.active.clone_from(&snapshot.active);
        self.last_call = LastCall::default();
        Ok(())
    }
}

/// Whether a contact is one of finite numbers, of a part that a model has.
fn is_sound(model: &Model, active: &ActiveContact) -> bool {
    let contact = &active.contact;
    let is_part = |part: Part, body: usize| part.is_of(model) && part.body(model) == body;
    let is_other = |other: &OtherSide| is_part(other.part, other.body);
    let is_paired = matches!(contact.key.opposite, Opposite::Part(_)) == contact.other.is_some();
    is_part(contact.part, contact.body)
        && contact.other.as_ref().is_none_or(is_other)
        && is_paired
        && contact.frame.rows().iter().flatten().all(|x| x.is_finite())
        && (contact.point.iter())
            .chain(&active.position)
            .chain(&active.impulse)
            .chain(&active.velocity)
            .all(|x| x.is_finite())
        && contact.gap.is_finite()
}

/// A command of `expected` finite entries.
pub(crate) fn check(
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
