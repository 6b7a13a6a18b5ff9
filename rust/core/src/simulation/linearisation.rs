//! Linearisation of a rover's step: `x⁺ ≈ f(x, u, θ) + A dx + B du + C dθ` with x = (q, v), q the
//! public coordinates, u = (wheel torques, or speeds while servos hold them; steering set-points)
//! and θ some [`StepParameter`]s. On soft ground x has the state of the sand behind.
//!
//! The step is the one that follows [`RoverSimulation::set_state`], without memory of earlier
//! impulses. The derivatives are those of [`super::differentiator`]. A check on demand takes two
//! real steps for each column of (A, B) and reports where modes change.

use nalgebra::{DMatrix, DVector};

use super::differentiator::{DifferentiatedStep, Differentiator, Modes};
use super::error::LinearisationError;
use super::rover::RoverSimulation;
use super::step_parameter::StepParameter;
use crate::contact::Part;
use crate::law::mode::ContactMode;

/// The derivatives of a step, and how far they hold.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// A (nx, nx).
    pub a: DMatrix<f64>,
    /// B (nx, 2 n_wheels).
    pub b: DMatrix<f64>,
    /// C (nx, number of parameters).
    pub c: DMatrix<f64>,
    /// The state (nx) about which it holds.
    pub state: Vec<f64>,
    /// The command (2 n_wheels) about which it holds.
    pub command: Vec<f64>,
    /// The state (nx) after the step.
    pub next_state: Vec<f64>,
    /// What touches in each contact (n_c).
    pub parts: Vec<Part>,
    /// Mode of each contact (n_c).
    pub modes: Vec<ContactMode>,
    /// Change of the velocity of each contact that would change its mode (n_c), m/s.
    pub margins: Vec<f64>,
    /// Whether the step moved the position out of penetration.
    pub is_projected: bool,
    /// What real steps say of the columns of (A, B), if asked.
    pub check: Option<ColumnCheck>,
}

/// What two real steps say of each column of (A, B).
#[derive(Clone, Debug)]
pub struct ColumnCheck {
    /// Whether the modes are the same in the two steps.
    pub holds: Vec<bool>,
    /// Largest difference from the central difference of the two steps, relative to the column's
    /// largest entry.
    pub errors: Vec<f64>,
}

/// Tested change of a torque, N m, for a unit of the perturbation.
const TORQUE: f64 = 1e3;

/// Error of a tested step's state that counts as rounding.
const ROUNDING: f64 = 1e-10;

/// Error of a column beyond which something has changed that no mode tells, such as the branch of a
/// motor or the facet under a wheel.
const CHANGED: f64 = 1e-3;

impl RoverSimulation {
    /// Derivatives of the next step by state, command and `parameters`; nothing changes.
    ///
    /// `perturbation`: size of the changes of a check by real steps, m, rad, m/s, rad/s; 1000 times
    /// as many N m. None without a check, which takes ten times as long as the rest.
    ///
    /// # Errors
    /// See [`LinearisationError`].
    pub fn linearise(
        &self,
        parameters: &[StepParameter],
        perturbation: Option<f64>,
    ) -> Result<Linearisation, LinearisationError> {
        if let Some(value) = perturbation.filter(|x| !(1e-9..=1e-3).contains(x)) {
            return Err(LinearisationError::Perturbation { value });
        }
        let mut differentiator = Differentiator::new(self)?;
        let state = differentiator.state_of(self);
        let columns = differentiator.differentiate(&state, parameters)?;
        let DifferentiatedStep {
            all,
            next_state,
            held,
        } = columns;
        let (nx, nu) = (state.len(), 2 * self.model().wheels().len());
        let check = perturbation.map(|perturbation| {
            let step = &held.step;
            let base = differentiator.modes_of(step.law.modes.iter().copied());
            test(&mut differentiator, (&state, &all), &base, perturbation)
        });
        Ok(Linearisation {
            a: all.columns(0, nx).into_owned(),
            b: all.columns(nx, nu).into_owned(),
            c: all.columns(nx + nu, parameters.len()).into_owned(),
            state,
            command: [
                self.wheel_speeds().unwrap_or(self.wheel_torques()),
                &self.steering(),
            ]
            .concat(),
            next_state,
            parts: held.step.contacts.iter().map(|c| c.part).collect(),
            margins: held.step.law.margins(),
            is_projected: held.step.projection.is_some(),
            modes: held.step.law.modes,
            check: check.transpose()?,
        })
    }
}

/// Whether the modes hold in two real steps for each column, and each column's error.
fn test(
    differentiator: &mut Differentiator,
    (state, all): (&[f64], &DMatrix<f64>),
    base: &Modes,
    perturbation: f64,
) -> Result<ColumnCheck, LinearisationError> {
    let (nx, nu) = (state.len(), 2 * differentiator.n_wheels());
    let (mut holds, mut errors) = (Vec::new(), Vec::new());
    for j in 0..nx + nu {
        let is_torque = (nx..nx + nu / 2).contains(&j) && !differentiator.has_servos();
        let step = perturbation * if is_torque { TORQUE } else { 1.0 };
        let (ahead, modes) = differentiator.take(state, (j, step))?;
        let mut is_same = modes.as_ref() == Some(base);
        let (back, modes) = differentiator.take(state, (j, -step))?;
        is_same &= modes.as_ref() == Some(base);
        let tested: DVector<f64> = differentiator.difference(&ahead, &back) / (2.0 * step);
        let column = all.column(j);
        let size = column.amax() + ROUNDING / step;
        let error = (tested - column).amax() / size;
        errors.push(error);
        holds.push(is_same && error <= CHANGED);
    }
    Ok(ColumnCheck { holds, errors })
}
