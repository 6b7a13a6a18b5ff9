//! Steps of a rover with their derivatives, one after another or along a trajectory.
//!
//! The state is x = (q, v) in public coordinates, the command u = (wheel torques, or speeds while
//! servos hold them; steering set-points). On soft ground the state has seven more entries a wheel:
//! what the sand remembers of it and the energy that it may give back. A step is that of
//! [`RoverSimulation::set_state`] followed by one step: it does not depend on steps before it.
//! `crate::system::tangent` differentiates it, eight directions at a time where the machine has
//! such registers; the bits are the same with four and with one.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{DMatrix, DVector, Vector3};

use super::error::LinearisationError;
use super::rover::{RoverScene, RoverSimulation};
use super::rover_command::RoverCommand;
use super::scene::{Scene, SceneKey, UsualOutcome};
use super::step_parameter::StepParameter;
use crate::contact::loops::check_closed;
use crate::integrator::held_step::{is_projected, law_of_last};
use crate::integrator::{NoProbe, StepReport, StepStart, UnilateralContact, Variant};
use crate::law::mode::ContactMode;
use crate::multibody::{Configuration, Model, coordinates};
use crate::scalar::elementary::sin_cos;
use crate::scalar::{Instructions, Single};
use crate::system::TreeSystem;
use crate::system::tangent::{Direction, HeldSand, HeldTree, OF_WHEEL, TangentPass, TangentScene};

/// Cosine of the pitch below which the coordinates count as singular.
const SINGULAR: f64 = 1e-6;

/// Relative difference up to which a step counts as the one that was taken.
const SAME: f64 = 1e-7;

/// Contacts that transmit impulses with their modes, whether the position was projected, whether
/// the energy audit slowed the motion, and whether each wheel touches sand and has emptied it.
pub(super) type Modes = (
    Vec<(SceneKey<RoverScene>, ContactMode)>,
    [bool; 2],
    Vec<[bool; 2]>,
);

/// A step with its derivatives.
pub(super) struct DifferentiatedStep {
    /// Derivatives of the next state by state, command and parameters, a column each.
    pub all: DMatrix<f64>,
    pub next_state: Vec<f64>,
    pub held: HeldTree,
}

/// A copy of a simulation that takes steps from states and commands, with their derivatives.
pub struct Differentiator {
    pub(super) sim: RoverSimulation,
    command: RoverCommand,
    passes: Passes,
    /// First indices of angles among the coordinates.
    angles: Vec<usize>,
    /// Report of the last step.
    pub(super) report: StepReport,
    /// The sand of the last step that was differentiated: its matrix serves the next one.
    pub(super) sand: Option<Arc<HeldSand>>,
}

/// Passes over a step with this machine's widest lanes.
enum Passes {
    Singles(Box<TangentPass<f64>>),
    #[cfg(target_arch = "x86_64")]
    Fours(Box<TangentPass<crate::scalar::Fours>>),
    #[cfg(target_arch = "x86_64")]
    Eights(Box<TangentPass<crate::scalar::Eights>>),
}

impl Passes {
    fn new(instructions: Instructions, model: &Model) -> Self {
        match instructions {
            Instructions::Baseline => {
                Self::Singles(Box::new(TangentPass::new(Single::Baseline, model)))
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => Self::Fours(Box::new(TangentPass::new(token, model))),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => Self::Eights(Box::new(TangentPass::new(token, model))),
        }
    }

    fn differentiate(
        &mut self,
        scene: &TangentScene<'_>,
        directions: &[Direction],
        end: &mut Configuration,
        take: impl FnMut(usize, &[f64], &[f64]),
    ) -> bool {
        match self {
            Self::Singles(tangent) => tangent.differentiate(scene, directions, end, take),
            #[cfg(target_arch = "x86_64")]
            Self::Fours(tangent) => tangent.differentiate(scene, directions, end, take),
            #[cfg(target_arch = "x86_64")]
            Self::Eights(tangent) => tangent.differentiate(scene, directions, end, take),
        }
    }
}

impl Differentiator {
    /// Differentiator of a simulation with its command, for this machine's instructions.
    ///
    /// # Errors
    /// `Variant`.
    pub fn new(of: &RoverSimulation) -> Result<Self, LinearisationError> {
        Self::with(of, Instructions::of_this_machine())
    }

    /// Differentiator of a simulation with its command, for the given instructions.
    ///
    /// # Errors
    /// `Variant`.
    pub fn with(
        of: &RoverSimulation,
        instructions: Instructions,
    ) -> Result<Self, LinearisationError> {
        if of.options.variant != Variant::Linearised {
            return Err(LinearisationError::Variant);
        }
        Ok(Self {
            sim: of.clone(),
            command: of.command().clone(),
            passes: Passes::new(instructions, of.model()),
            angles: coordinates::angular_blocks(of.model()).collect(),
            report: StepReport::default(),
            sand: None,
        })
    }

    /// Number of wheels.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.sim.model().wheels().len()
    }

    /// Whether servos hold the wheels' speeds.
    pub(super) fn has_servos(&self) -> bool {
        self.command.wheel_speed.is_some()
    }

    fn nv(&self) -> usize {
        self.sim.model().nv()
    }

    /// The state (nx) of a simulation.
    #[must_use]
    pub fn state_of(&self, sim: &RoverSimulation) -> Vec<f64> {
        let q = coordinates::to_public(sim.model(), sim.q());
        let mut state = [q, sim.v().to_vec()].concat();
        let wheels = sim.sand().into_iter().flat_map(|sand| &sand.wheels);
        state.extend(wheels.flat_map(Self::sand_entries));
        state
    }

    /// Sets the command (2 n_wheels), within the limits of the wheels' torques.
    ///
    /// # Errors
    /// `Command`.
    pub fn set_command(&mut self, command: &[f64]) -> Result<(), LinearisationError> {
        let (torques, steering) = command.split_at(command.len() / 2);
        self.sim.command = self.command.clone();
        self.sim.set_wheel_torques(torques)?;
        self.sim.set_steering(steering)?;
        self.command = self.sim.command.clone();
        Ok(())
    }

    /// Sets a state (nx), with its loops closed, and the command.
    pub(super) fn set(&mut self, state: &[f64]) -> Result<(), LinearisationError> {
        let nv = self.nv();
        let configuration = coordinates::from_public(self.sim.model(), &state[..nv])?;
        let v = coordinates::checked_velocity(self.sim.model(), &state[nv..2 * nv])?;
        let sand = self.sim.memory.sand.take();
        self.sim.set_state(configuration, v);
        self.sim.memory.sand = sand;
        self.set_sand(&state[2 * nv..]);
        self.sim.command = self.command.clone();
        Ok(())
    }

    /// Takes a real step from a state with the command of the copy, and returns the state after it.
    ///
    /// The contact problem may have several solutions. A step with the usual effort finds that of a
    /// simulation, and one with all effort, which leaves its matrices, begins with it.
    fn step(&mut self, state: &[f64]) -> Result<Vec<f64>, LinearisationError> {
        if self.sim.memory.sand.is_some() {
            return self.step_in_sand(state);
        }
        let command = self.sim.command.clone();
        let sim = &mut self.sim;
        let is_rigid = !sim.model().has_compliance();
        let usual = if is_rigid {
            sim.usual_step(&mut NoProbe)?
        } else {
            UsualOutcome::None
        };
        match usual {
            UsualOutcome::None => {}
            UsualOutcome::Refused(obstacle) => sim.scratch.note(obstacle),
            UsualOutcome::Taken(_) => {
                let mut found = sim.warm_start.clone();
                found.persistent.clear();
                self.set(state)?;
                self.sim.command = command;
                self.sim.warm_start = found;
            }
        }
        self.report = (self.sim).step_with_all_effort(&Variant::Linearised, &mut NoProbe)?;
        Ok(self.state_of(&self.sim))
    }

    /// Modes of the contacts of the step that was just taken.
    pub(super) fn modes_of(&self, modes: impl Iterator<Item = ContactMode>) -> Modes {
        let contacts = self.sim.scratch.contacts().iter();
        let closed = contacts
            .zip(modes)
            .filter(|(_, mode)| *mode != ContactMode::Open);
        let modes = closed
            .map(|(contact, mode)| (contact.key(), mode))
            .collect();
        let projects = is_projected::<TreeSystem<'_>>(&self.sim.options, &self.sim.scratch);
        let in_sand = self.sim.parts.tree.modes_of_sand();
        (modes, [projects, self.report.energy_removed > 0.0], in_sand)
    }

    /// The state after a real step with one entry of state and command changed, and its modes.
    /// Limits of the commands do not apply.
    pub(super) fn take(
        &mut self,
        state: &[f64],
        (entry, change): (usize, f64),
    ) -> Result<(Vec<f64>, Option<Modes>), LinearisationError> {
        let mut changed = state.to_vec();
        if let Some(x) = changed.get_mut(entry) {
            *x += change;
        }
        self.set(&changed)?;
        if let Some(entry) = entry.checked_sub(state.len()) {
            self.change_command(entry, change);
        }
        let end = self.step(&changed)?;
        let sim = &mut self.sim;
        let (command, memory) = (&sim.command, &mut sim.memory);
        let system = (sim.scene).system(&sim.options, command, memory, &mut sim.parts);
        let law = law_of_last(&system, &sim.scratch);
        drop(system);
        let modes = law.map(|law| self.modes_of(law.modes.into_iter()));
        Ok((end, modes))
    }

    /// What an entry of the command varies, if anything.
    fn command_direction(&self, entry: usize) -> Option<Direction> {
        let wheels = self.sim.model().wheels();
        if let Some(steered) = entry.checked_sub(wheels.len()) {
            return wheels[steered].steering.map(Direction::SetPoint);
        }
        let (wheel, j) = (&wheels[entry], wheels[entry].joint?);
        let servo = self.sim.command.actuators.drives[j].and_then(|drive| drive.servo);
        let share = servo.map_or(1.0, |servo| wheel.speed_gain / servo.gain);
        Some(Direction::Command(j, wheel.drive_sign * share))
    }

    fn change_command(&mut self, entry: usize, change: f64) {
        let direction = self.command_direction(entry);
        let actuators = &mut self.sim.command.actuators;
        match direction {
            Some(Direction::Command(joint, sign)) => {
                if let Some(drive) = &mut actuators.drives[joint] {
                    match &mut drive.servo {
                        Some(servo) => servo.speed += sign * change,
                        None => drive.torque += sign * change,
                    }
                }
            }
            Some(Direction::SetPoint(joint)) => {
                if let Some(held) = &mut actuators.held[joint] {
                    held.set_point += change;
                }
            }
            _ => {}
        }
    }

    /// `a − b` of two states, with angles the short way round.
    pub(super) fn difference(&self, a: &[f64], b: &[f64]) -> DVector<f64> {
        let turn = std::f64::consts::TAU;
        let mut out = DVector::from_iterator(a.len(), a.iter().zip(b).map(|(a, b)| a - b));
        for k in &self.angles {
            for i in *k..k + 3 {
                out[i] -= turn * (out[i] / turn).round();
            }
        }
        out
    }

    fn check_angles(&self, state: &[f64]) -> Result<(), LinearisationError> {
        for k in &self.angles {
            let (index, pitch) = (k + 2, state[k + 2]);
            if sin_cos(pitch).1.abs() < SINGULAR {
                return Err(LinearisationError::Singular { index, pitch });
            }
        }
        Ok(())
    }

    /// What varies in each column that is not zero.
    fn directions(
        &self,
        state: &[f64],
        parameters: &[StepParameter],
        numbers: &[usize],
    ) -> Vec<(usize, Direction)> {
        let (nv, n, nx) = (self.nv(), self.n_wheels(), state.len());
        let mut all = Vec::with_capacity(nx + 2 * n + parameters.len());
        all.extend((0..nv).map(|k| (k, Direction::Configuration([(k, 1.0), (k, 0.0), (k, 0.0)]))));
        for &k in &self.angles {
            let axes = coordinates::axes_of_angles([state[k], state[k + 1], state[k + 2]]);
            for (i, axis) in axes.column_iter().enumerate() {
                let rates = [(k, axis[0]), (k + 1, axis[1]), (k + 2, axis[2])];
                all[k + i].1 = Direction::Configuration(rates);
            }
        }
        all.extend((0..nv).map(|k| (nv + k, Direction::Velocity(k))));
        let of_sand = (0..nx - 2 * nv).map(|k| Direction::Sand(k / OF_WHEEL, k % OF_WHEEL));
        all.extend((2 * nv..nx).zip(of_sand));
        let commands = (0..2 * n).filter_map(|i| Some((nx + i, self.command_direction(i)?)));
        all.extend(commands);
        let soil = self.sim.terrain().soft().map(|layer| &**layer.soil);
        let directions = parameters.iter().map(|own| own.direction(soil, numbers));
        all.extend((nx + 2 * n..).zip(directions));
        all
    }

    /// Takes the step from a state (nx) and differentiates it.
    pub(super) fn differentiate(
        &mut self,
        state: &[f64],
        parameters: &[StepParameter],
    ) -> Result<DifferentiatedStep, LinearisationError> {
        self.check_angles(state)?;
        self.set(state)?;
        let (begin, v) = (self.sim.q().clone(), self.sim.v().to_vec());
        let next_state = self.step(state)?;
        self.check_angles(&next_state)?;
        let numbers: Vec<usize> = (parameters.iter())
            .filter_map(|parameter| match parameter {
                StepParameter::Soil(number) => Some(*number),
                _ => None,
            })
            .collect();
        let directions = self.directions(state, parameters, &numbers);
        let (nv, nx) = (self.nv(), state.len());
        let sim = &mut self.sim;
        let start = StepStart::at(&begin, &v);
        let (command, memory) = (&sim.command, &mut sim.memory);
        let mut system = (sim.scene).system(&sim.options, command, memory, &mut sim.parts);
        let held = system.hold(&sim.options, start, &sim.scratch, &numbers);
        drop(system);
        let held = held.ok_or(LinearisationError::NotHeld)?;
        self.sand.clone_from(&held.sand);
        let scene = TangentScene {
            model: &sim.scene.model,
            command: &sim.command.actuators,
            options: &sim.options,
            start,
            v_end: &next_state[nv..2 * nv],
            held: &held,
        };
        let to_rates: Vec<_> = (self.angles.iter())
            .map(|&k| {
                let angles = [next_state[k], next_state[k + 1], next_state[k + 2]];
                let axes = coordinates::axes_of_angles(angles);
                (k, axes.try_inverse().unwrap_or_default())
            })
            .collect();
        let n_columns = nx + 2 * sim.scene.model.wheels().len() + parameters.len();
        let mut all = DMatrix::zeros(nx, n_columns);
        let mut end = begin.clone();
        let kinds: Vec<Direction> = directions.iter().map(|(_, direction)| *direction).collect();
        let holds = (self.passes).differentiate(&scene, &kinds, &mut end, |i, motion, dv| {
            let mut column = all.column_mut(directions[i].0);
            let column = column.as_mut_slice();
            column[..nv].copy_from_slice(motion);
            column[nv..].copy_from_slice(dv);
            for (k, to_rates) in &to_rates {
                let turn = Vector3::from_column_slice(&motion[*k..k + 3]);
                column[*k..k + 3].copy_from_slice((to_rates * turn).as_slice());
            }
        });
        let reached = coordinates::to_public(&self.sim.scene.model, &end);
        let off = self.difference(&reached, &next_state[..nv]).amax();
        let size = next_state.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        if !holds || off.is_nan() || off > SAME * size {
            return Err(LinearisationError::NotHeld);
        }
        Ok(DifferentiatedStep {
            all,
            next_state,
            held,
        })
    }
}

/// Number of entries of the state: nx.
#[must_use]
pub fn state_size(of: &RoverSimulation) -> usize {
    2 * of.model().nv() + of.sand().map_or(0, |sand| OF_WHEEL * sand.wheels.len())
}

/// States (n, nx) of these coordinates and velocities (n, 2 nv), with the sand as it is in a
/// simulation.
#[must_use]
pub fn with_sand(of: &RoverSimulation, states: &[f64]) -> Vec<f64> {
    let wheels = of.sand().into_iter().flat_map(|sand| &sand.wheels);
    let own: Vec<f64> = wheels.flat_map(Differentiator::sand_entries).collect();
    let rows = states.chunks_exact(2 * of.model().nv());
    rows.flat_map(|row| row.iter().chain(&own).copied())
        .collect()
}

/// Steps of a trajectory with their derivatives. Matrices are row-major, one step after another.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// States (n + 1, nx).
    pub states: Vec<f64>,
    /// Derivatives of the next state by the state (n, nx, nx).
    pub a: Vec<f64>,
    /// By the command (n, nx, 2 n_wheels); zero for torques beyond their limit.
    pub b: Vec<f64>,
    /// By the parameters (n, nx, number of parameters).
    pub c: Vec<f64>,
}

/// A trajectory that ended early.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryError {
    /// Number of the step, from 0.
    pub step: usize,
    /// Why.
    pub error: LinearisationError,
}

impl Differentiator {
    /// Takes `n` steps, one for each command (n, 2 n_wheels), from a state (nx), with the
    /// derivatives of each.
    ///
    /// # Errors
    /// The first step that cannot be differentiated.
    ///
    /// # Panics
    /// If there are fewer commands.
    pub fn trajectory(
        &mut self,
        state: &[f64],
        (n, commands): (usize, &[f64]),
        parameters: &[StepParameter],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Trajectory, TrajectoryError> {
        let (nx, nu) = (state.len(), 2 * self.n_wheels());
        let refused = |error| TrajectoryError { step: 0, error };
        let model = self.sim.model();
        (coordinates::from_public(model, &state[..model.nv()]))
            .and_then(|q| check_closed(model, &q))
            .map_err(|error| refused(error.into()))?;
        let mut out = Trajectory {
            states: state.to_vec(),
            ..Trajectory::default()
        };
        let mut state = state.to_vec();
        self.sand = None;
        for step in 0..n {
            let command = &commands[step * nu..][..nu];
            let taken =
                (self.set_command(command)).and_then(|()| self.differentiate(&state, parameters));
            let mut columns = taken.map_err(|error| TrajectoryError { step, error })?;
            let wheels = self.sim.model().wheels().iter();
            for (i, (torque, wheel)) in command.iter().zip(wheels).enumerate() {
                if torque.abs() > wheel.torque_limit {
                    columns.all.column_mut(nx + i).fill(0.0);
                }
            }
            state.clone_from(&columns.next_state);
            out.states.extend_from_slice(&state);
            for row in columns.all.row_iter() {
                out.a.extend(row.columns(0, nx).iter());
                out.b.extend(row.columns(nx, nu).iter());
                out.c.extend(row.columns(nx + nu, parameters.len()).iter());
            }
            if !go_on() {
                break;
            }
        }
        Ok(out)
    }
}

/// Trajectories of a batch: states (n, nx) and the commands of each (n, steps, 2 n_wheels).
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryBatch<'a> {
    /// A row each.
    pub states: &'a [f64],
    /// Commands of each trajectory (n, steps, 2 n_wheels), row-major.
    pub commands: &'a [f64],
    /// Number of steps of each.
    pub steps: usize,
    /// By which the steps are differentiated.
    pub parameters: &'a [StepParameter],
}

impl TrajectoryBatch<'_> {
    /// Takes the trajectories of copies of a simulation on some threads, each as
    /// [`Differentiator::trajectory`] does. Once `go_on` returns false, all end after a whole step.
    ///
    /// # Errors
    /// `Variant`, or the number of the first trajectory that fails, and why.
    ///
    /// # Panics
    /// If a slice has a wrong length.
    pub fn take(
        &self,
        of: &RoverSimulation,
        threads: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Trajectory>, (usize, TrajectoryError)> {
        let nx = state_size(of);
        let n = self.states.len() / nx;
        assert_eq!(self.states.len(), n * nx, "one row a trajectory");
        let length = 2 * self.steps * of.model().wheels().len();
        assert_eq!(self.commands.len(), n * length, "as many commands for each");
        let goes_on = AtomicBool::new(true);
        let take = |range: Range<usize>, go_on: &mut dyn FnMut() -> bool| {
            let failed = |i: usize| move |error: TrajectoryError| (i, error);
            let refused = |error| failed(range.start)(TrajectoryError { step: 0, error });
            let mut differentiator = Differentiator::new(of).map_err(refused)?;
            let own = range.clone().map(|i| {
                let (state, commands) = (
                    &self.states[i * nx..][..nx],
                    &self.commands[i * length..][..length],
                );
                let commands = (self.steps, commands);
                (differentiator.trajectory(state, commands, self.parameters, go_on))
                    .map_err(failed(i))
            });
            own.collect::<Result<Vec<_>, _>>()
        };
        let share = n.div_ceil(threads.max(1)).max(1);
        let parts = std::thread::scope(|scope| {
            let others: Vec<_> = (share..n)
                .step_by(share)
                .map(|first| {
                    let (take, goes_on) = (&take, &goes_on);
                    let range = first..(first + share).min(n);
                    scope.spawn(move || take(range, &mut || goes_on.load(Ordering::Relaxed)))
                })
                .collect();
            let mut watched = || {
                let goes = go_on();
                goes_on.store(goes, Ordering::Relaxed);
                goes
            };
            let mut parts = vec![take(0..share.min(n), &mut watched)];
            for other in others {
                parts.push(
                    other
                        .join()
                        .unwrap_or_else(|e| std::panic::resume_unwind(e)),
                );
            }
            parts
        });
        let mut all = Vec::with_capacity(n);
        for part in parts {
            all.extend(part?);
        }
        Ok(all)
    }
}
