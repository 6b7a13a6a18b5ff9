//! Linearisation of a rover's step: `x⁺ ≈ f(x, u) + A dx + B du` with x = (q, v), q the public
//! coordinates, and u = (wheel torques, steering set-points).
//!
//! The step is the one that follows [`RoverSimulation::set_state`], without memory of earlier
//! impulses. Its contacts and their modes are held (`integrator::held_step`): the
//! derivatives of the explicit, smooth parts are fourth-order central differences, and the
//! implicit function theorem gives that of the solution. Only the test at the end differences
//! whole steps: it takes two for each column and reports where modes change.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use super::rover::{RoverScene, RoverSimulation};
use super::rover_command::RoverCommand;
use super::scene::{Scene, SceneKey, SceneScratch};
use crate::contact::Part;
use crate::integrator::held_step::{HeldStep, law_of_last};
use crate::integrator::{ContactMode, NoProbe, Start, StepError, UnilateralContact, Variant};
use crate::multibody::{Configuration, Model, coordinates};
use crate::scalar::elementary::sin_cos;
use crate::system::TreeSystem;

/// The derivatives of a step, and how far they hold.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// A (2 nv, 2 nv).
    pub a: DMatrix<f64>,
    /// B (2 nv, 2 n_wheels).
    pub b: DMatrix<f64>,
    /// The state (2 nv) about which it holds.
    pub state: Vec<f64>,
    /// The command (2 n_wheels) about which it holds.
    pub command: Vec<f64>,
    /// The state (2 nv) after the step.
    pub next_state: Vec<f64>,
    /// What touches in each contact (n_c).
    pub parts: Vec<Part>,
    /// Mode of each contact (n_c).
    pub modes: Vec<ContactMode>,
    /// Change of the velocity of each contact that would change its mode (n_c), m/s.
    pub margins: Vec<f64>,
    /// Whether the step moved the position out of penetration.
    pub is_projected: bool,
    /// Whether the modes are the same in the two tested steps of each column of (A, B).
    pub holds: Vec<bool>,
    /// Largest difference of each column of (A, B) from the central difference of the two tested
    /// steps, relative to its largest entry.
    pub errors: Vec<f64>,
}

/// A step that cannot be linearised.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LinearisationError {
    /// The scheme is implicit in the forces.
    #[error("variant: only steps of the variant \"linearised\" can be linearised")]
    Variant,
    /// A perturbation outside its range.
    #[error("perturbation: must be from 1e-9 to 1e-3, is {value}")]
    Perturbation {
        /// What was given.
        value: f64,
    },
    /// The coordinates are singular.
    #[error("q[{index}]: the coordinates are singular at a pitch of 90 degrees, is {pitch} rad")]
    Singular {
        /// Index of the angle.
        index: usize,
        /// rad.
        pitch: f64,
    },
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The step is not one solution of the step's equations.
    #[error(
        "the step was split, was not solved to its tolerance, or was limited, so it has no \
         derivative with fixed contact modes"
    )]
    NotHeld,
}

/// Step of the differences in q (m, rad), in v (m/s, rad/s), in a torque (N m), in a set-point
/// (rad). The smooth parts are linear in the last two.
const STEPS: [f64; 4] = [1e-4, 1e-3, 0.1, 1e-5];

/// Tested change of a torque, N m, for a unit of the perturbation.
const TORQUE: f64 = 1e3;

/// Error of a tested step's state that counts as rounding.
const ROUNDING: f64 = 1e-10;

/// Error of a column beyond which something has changed that no mode tells, such as the branch of a
/// motor.
const CHANGED: f64 = 1e-2;

/// Relative difference up to which a step counts as the one that was taken.
const SAME: f64 = 1e-7;

/// Cosine of the pitch below which the coordinates count as singular.
const SINGULAR: f64 = 1e-6;

impl RoverSimulation {
    /// Derivatives of the next step by state and command; nothing changes.
    ///
    /// `perturbation`: size of the tested changes, m, rad, m/s, rad/s; 1000 times as many N m.
    ///
    /// # Errors
    /// See [`LinearisationError`].
    pub fn linearise(&self, perturbation: f64) -> Result<Linearisation, LinearisationError> {
        if !(1e-9..=1e-3).contains(&perturbation) {
            let value = perturbation;
            return Err(LinearisationError::Perturbation { value });
        }
        if self.options.variant != Variant::Linearised {
            return Err(LinearisationError::Variant);
        }
        let mut scratch = ScratchSimulation::new(self)?;
        let next_state = scratch.take(None)?;
        let key = scratch.modes();
        let parts = scratch
            .sim
            .scratch
            .contacts()
            .iter()
            .map(|c| c.part)
            .collect();
        let nv = scratch.v.len();
        let (held, reached) = scratch
            .at(None, |system, options, start, ws| {
                let held = HeldStep::of(system, options, start, &next_state[nv..], ws)?;
                let (v, displacement) = held.solution();
                let reached = held.finish(system, start, v.as_slice(), displacement.as_slice(), ws);
                Some((held, reached))
            })
            .ok_or(LinearisationError::NotHeld)?;
        let reached = scratch.state(&reached);
        let off = scratch.difference(&reached, &next_state, 1.0);
        let size = next_state.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        if off.amax() > SAME * size {
            return Err(LinearisationError::NotHeld);
        }
        let all = scratch
            .derive(&held, &reached)
            .ok_or(LinearisationError::NotHeld)?;
        let (holds, errors) = scratch.test(&all, &key, perturbation)?;
        let (nx, nu) = (2 * nv, scratch.n_inputs());
        Ok(Linearisation {
            a: all.columns(0, nx).into_owned(),
            b: all.columns(nx, nu).into_owned(),
            state: [&scratch.q[..], &scratch.v].concat(),
            command: [self.wheel_torques(), &self.steering()].concat(),
            next_state,
            parts,
            modes: held.law.modes.clone(),
            margins: held.law.margins(),
            is_projected: held.is_projected(),
            holds,
            errors,
        })
    }
}

/// Contacts that transmit impulses with their modes, whether the position was projected, and
/// whether the energy audit slowed the motion.
type Modes = (Vec<(SceneKey<RoverScene>, ContactMode)>, [bool; 2]);

/// A copy of a simulation that is set to states and commands near a base.
struct ScratchSimulation {
    sim: RoverSimulation,
    q: Vec<f64>,
    v: Vec<f64>,
    command: RoverCommand,
    /// First indices of angles among the coordinates.
    angles: Vec<usize>,
    /// Whether the energy audit slowed the last step.
    is_slowed: bool,
}

impl ScratchSimulation {
    fn new(of: &RoverSimulation) -> Result<Self, LinearisationError> {
        let model: &Arc<Model> = of.model();
        let q = coordinates::to_public(model, of.q());
        let angles: Vec<usize> = coordinates::angular_blocks(model).collect();
        for k in &angles {
            let (index, pitch) = (k + 2, q[k + 2]);
            if sin_cos(pitch).1.abs() < SINGULAR {
                return Err(LinearisationError::Singular { index, pitch });
            }
        }
        Ok(Self {
            q,
            v: of.v().to_vec(),
            command: of.command().clone(),
            sim: of.clone(),
            angles,
            is_slowed: false,
        })
    }

    fn n_inputs(&self) -> usize {
        2 * self.sim.model().wheels().len()
    }

    fn n_columns(&self) -> usize {
        2 * self.v.len() + self.n_inputs()
    }

    /// Kind of a column: 0 coordinate, 1 velocity, 2 torque, 3 set-point.
    fn kind(&self, column: usize) -> usize {
        let (nv, n) = (self.v.len(), self.sim.model().wheels().len());
        match column {
            j if j < nv => 0,
            j if j < 2 * nv => 1,
            j if j < 2 * nv + n => 2,
            _ => 3,
        }
    }

    /// Sets the base, with one entry of (x, u) changed. Limits of the commands do not apply.
    fn set(&mut self, change: Option<(usize, f64)>) {
        let model = self.sim.model().clone();
        let (mut q, mut v, mut command) = (self.q.clone(), self.v.clone(), self.command.clone());
        if let Some((column, amount)) = change {
            let (nv, wheels) = (v.len(), model.wheels());
            match self.kind(column) {
                0 => q[column] += amount,
                1 => v[column - nv] += amount,
                2 => {
                    let wheel = &wheels[column - 2 * nv];
                    let drive = wheel
                        .joint
                        .and_then(|j| command.actuators.drives[j].as_mut());
                    if let Some(drive) = drive {
                        drive.torque += wheel.drive_sign * amount;
                    }
                }
                _ => {
                    let wheel = &wheels[column - 2 * nv - wheels.len()];
                    let held = wheel
                        .steering
                        .and_then(|j| command.actuators.held[j].as_mut());
                    if let Some(held) = held {
                        held.set_point += amount;
                    }
                }
            }
        }
        if let Ok(configuration) = coordinates::from_public(&model, &q) {
            self.sim.place(configuration, v);
        }
        self.sim.command = command;
    }

    /// Calls `f` with the system at the base with one entry changed.
    fn at<T>(
        &mut self,
        change: Option<(usize, f64)>,
        f: impl FnOnce(
            &mut TreeSystem<'_>,
            &crate::integrator::StepOptions,
            Start<'_, Configuration>,
            &mut SceneScratch<RoverScene>,
        ) -> T,
    ) -> T {
        self.set(change);
        let sim = &mut self.sim;
        let mut system = sim.scene.system(&sim.command, &sim.memory, &mut sim.parts);
        let start = Start {
            configuration: &sim.state.configuration,
            v: &sim.state.v,
        };
        f(&mut system, &sim.options, start, &mut sim.scratch)
    }

    /// Takes a real step and returns the state after it.
    fn take(&mut self, change: Option<(usize, f64)>) -> Result<Vec<f64>, StepError> {
        self.set(change);
        let report = self.sim.general_step(&Variant::Linearised, &mut NoProbe)?;
        self.is_slowed = report.energy_removed > 0.0;
        let state = &self.sim.state;
        let configuration = coordinates::to_public(self.sim.model(), &state.configuration);
        Ok([configuration, state.v.clone()].concat())
    }

    /// Modes of the step that was just taken.
    fn modes(&mut self) -> Modes {
        let sim = &mut self.sim;
        let system = sim.scene.system(&sim.command, &sim.memory, &mut sim.parts);
        let (law, is_projected) = law_of_last(&system, &sim.options, &sim.scratch);
        let closed = sim.scratch.contacts().iter().zip(&law.modes);
        let closed = closed.filter(|(_, mode)| **mode != ContactMode::Open);
        let modes = closed.map(|(contact, mode)| (contact.key(), *mode));
        (modes.collect(), [is_projected, self.is_slowed])
    }

    fn state(&self, (configuration, v): &(Configuration, Vec<f64>)) -> Vec<f64> {
        [
            coordinates::to_public(self.sim.model(), configuration),
            v.clone(),
        ]
        .concat()
    }

    /// `(a − b) / h` of two states, with angles the short way round.
    fn difference(&self, a: &[f64], b: &[f64], h: f64) -> DVector<f64> {
        let turn = std::f64::consts::TAU;
        let mut out = DVector::from_iterator(a.len(), a.iter().zip(b).map(|(a, b)| a - b));
        for k in &self.angles {
            for i in *k..k + 3 {
                out[i] -= turn * (out[i] / turn).round();
            }
        }
        out / h
    }

    /// (A, B) by the implicit function theorem; `reached` is the state after the step.
    fn derive(
        &mut self,
        held: &HeldStep<<RoverScene as Scene>::Contact>,
        reached: &[f64],
    ) -> Option<DMatrix<f64>> {
        let columns: Vec<(usize, f64)> = (0..self.n_columns())
            .map(|j| (j, STEPS[self.kind(j)]))
            .collect();
        let mut trials = Vec::with_capacity(columns.len());
        for &(j, step) in &columns {
            trials.push(slope(step, |amount| {
                let of = self.at(Some((j, amount)), |system, _, start, ws| {
                    held.trial(system, start, ws)
                });
                of.map(DVector::from_vec)
            })?);
        }
        let response = held.respond(&DMatrix::from_columns(&trials));
        let (v, displacement) = held.solution();
        let mut ends = Vec::with_capacity(columns.len());
        for &(j, step) in &columns {
            ends.push(slope(step, |amount| {
                let v = v + amount * response.v.column(j);
                let displacement = displacement + amount * response.displacement.column(j);
                let end = self.at(Some((j, amount)), |system, _, start, ws| {
                    held.finish(system, start, v.as_slice(), displacement.as_slice(), ws)
                });
                let end = self.state(&end);
                Some(self.difference(&end, reached, 1.0))
            })?);
        }
        Some(DMatrix::from_columns(&ends))
    }

    /// Whether the modes hold in two real steps for each column, and each column's error.
    fn test(
        &mut self,
        all: &DMatrix<f64>,
        base: &Modes,
        perturbation: f64,
    ) -> Result<(Vec<bool>, Vec<f64>), StepError> {
        let (mut holds, mut errors) = (Vec::new(), Vec::new());
        for j in 0..self.n_columns() {
            let step = perturbation * if self.kind(j) == 2 { TORQUE } else { 1.0 };
            let ahead = self.take(Some((j, step)))?;
            let mut is_same = self.modes() == *base;
            let back = self.take(Some((j, -step)))?;
            is_same &= self.modes() == *base;
            let tested = self.difference(&ahead, &back, 2.0 * step);
            let column = all.column(j);
            let size = column.amax() + ROUNDING / step;
            let error = (tested - column).amax() / size;
            errors.push(error);
            holds.push(is_same && error <= CHANGED);
        }
        Ok((holds, errors))
    }
}

/// Derivative at 0, of fourth order in the step.
fn slope(step: f64, mut f: impl FnMut(f64) -> Option<DVector<f64>>) -> Option<DVector<f64>> {
    let near = f(step)? - f(-step)?;
    let far = f(2.0 * step)? - f(-2.0 * step)?;
    Some((near * 8.0 - far) / (12.0 * step))
}
