//! `Linearisation`: the derivatives of a step.

use pyo3::prelude::*;
use rover_core::contact::Part;
use rover_core::integrator::ContactMode;
use rover_core::multibody::Model;
use rover_core::simulation::{Linearisation as Core, LinearisationError};

use crate::arrays::{Array, fresh_matrix};
use crate::errors::{BorderError, Kind, Value, entry};

/// Derivatives of a time step with respect to state and command, returned by
/// `Simulation.linearise`.
///
/// `x_next = next_state + a @ (x - state) + b @ (u - command)` to first order. The state is
/// x = (q, v) as `Simulation.q` and `Simulation.v` return them, the command is u = (wheel torques,
/// steering set-points). All arrays are new.
#[pyclass(module = "rover_gym.mechanics", frozen, get_all)]
pub struct Linearisation {
    /// Derivative of the next state by the state, (nx, nx) with nx = 2 nv.
    a: Array,
    /// Derivative of the next state by the command, (nx, nu) with nu = 2 n_wheels.
    ///
    /// Columns of wheels without a drive or without steering are 0.
    b: Array,
    /// State before the step, (nx,).
    state: Array,
    /// Command of the step, (nu,).
    command: Array,
    /// State after the step, (nx,).
    next_state: Array,
    /// For each contact, the name of the solid, or of the joint that is at its stop.
    bodies: Vec<String>,
    /// Mode of each contact, "open", "stick" or "slip".
    ///
    /// An open contact transmits no impulse. A contact without friction is "slip" while closed.
    modes: Vec<&'static str>,
    /// Distance of each contact from a change of its mode, (n,), m/s; rad/s at a joint's stop.
    ///
    /// For an open contact it is the normal velocity. For a closed contact it is the smaller of two
    /// values: the normal impulse times the inverse effective mass along the normal, and, if
    /// sticking, mu p_N - |p_T| times the same factor, or, if slipping, the sliding speed.
    margins: Array,
    /// Whether the step removes penetration. If so, the derivative includes this correction.
    is_projected: bool,
    /// Whether each column of (a, b) is valid within the tested perturbation, (nx + nu,).
    ///
    /// A column is valid if two perturbed steps, one in each direction, have the same closed
    /// contacts in the same modes, the same projection and energy correction, and agree with the
    /// column within 1%.
    holds: Array<bool>,
    /// Difference of each column of (a, b) from the difference quotient of its two perturbed steps,
    /// (nx + nu,).
    ///
    /// The largest difference of an entry, relative to the column's largest entry.
    errors: Array,
    /// Whether all columns are valid.
    is_smooth: bool,
}

impl Linearisation {
    pub fn new(model: &Model, inner: Core) -> Self {
        let word = |mode: &ContactMode| match mode {
            ContactMode::Open => "open",
            ContactMode::Stick => "stick",
            ContactMode::Slip => "slip",
        };
        let name = |part: &Part| part.name(model).to_owned();
        Self {
            a: fresh_matrix(&inner.a),
            b: fresh_matrix(&inner.b),
            state: inner.state.into(),
            command: inner.command.into(),
            next_state: inner.next_state.into(),
            bodies: inner.parts.iter().map(name).collect(),
            modes: inner.modes.iter().map(word).collect(),
            margins: inner.margins.into(),
            is_projected: inner.is_projected,
            is_smooth: inner.holds.iter().all(|holds| *holds),
            holds: inner.holds.into(),
            errors: inner.errors.into(),
        }
    }
}

#[pymethods]
impl Linearisation {
    fn __repr__(&self) -> String {
        let (nx, nu, modes) = (self.state.len(), self.command.len(), &self.modes);
        let broken = self.holds.values().iter().filter(|holds| !**holds).count();
        format!(
            "Linearisation(nx={nx}, nu={nu}, modes={modes:?}, columns that do not hold={broken})"
        )
    }
}

impl From<LinearisationError> for BorderError {
    fn from(e: LinearisationError) -> Self {
        let message = e.to_string();
        match e {
            LinearisationError::Variant => {
                Kind::Option.error("variant", message, Value::Text("newton".to_owned()))
            }
            LinearisationError::Perturbation { value } => {
                Kind::Option.error("perturbation", message, Value::Number(value))
            }
            LinearisationError::Singular { index, pitch } => {
                Kind::State.error(entry("q", Some(&index)), message, Value::Number(pitch))
            }
            LinearisationError::Step(e) => e.into(),
            LinearisationError::NotHeld => Kind::Step.refusal(message, Value::Nothing),
        }
    }
}
