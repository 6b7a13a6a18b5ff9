//! `Linearisation`: the derivatives of a step; `StepDerivatives`: those of many.

use pyo3::prelude::*;
use rover_core::contact::Part;
use rover_core::law::mode::ContactMode;
use rover_core::multibody::Model;
use rover_core::simulation::{
    Linearisation as Core, LinearisationError, RoverSimulation, StepParameter, Trajectory,
    TrajectoryError,
};

use crate::arguments::texts;
use crate::arrays::{Array, fresh, fresh_matrix};
use crate::errors::{BorderError, Kind, Result, Value, entry};

/// Derivatives of a time step, returned by `Simulation.linearise`.
///
/// `x_next = next_state + a @ (x - state) + b @ (u - command)` to first order. The state is x = (q,
/// v) as `Simulation.q` and `Simulation.v` return them, the command is u = (wheel torques, steering
/// set-points). On soft ground seven numbers a wheel follow in x: the displacement of its centre
/// (3) and its rotation (3) that the sand remembers, in units of its memory (1 and 1/m, world
/// axes), and the energy that the sand may give back, J. All arrays are new.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct Linearisation {
    /// Derivative of the next state by the state, (nx, nx) with nx = 2 nv, or 2 nv + 7 n_wheels.
    a: Array,
    /// Derivative of the next state by the command, (nx, nu) with nu = 2 n_wheels.
    ///
    /// Columns of wheels without a drive or without steering are 0.
    b: Array,
    /// Derivative of the next state by the parameters that were asked for, (nx, n_parameters).
    c: Array,
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
    /// None without `check`. A column is valid if two perturbed steps, one in each direction, have
    /// the same closed contacts in the same modes, the same projection and energy correction, the
    /// same wheels in sand, and agree with the column within 0.1%.
    holds: Option<Array<bool>>,
    /// Difference of each column of (a, b) from that of its two perturbed steps, (nx + nu,).
    ///
    /// None without `check`. The largest difference of an entry, relative to the column's largest
    /// entry.
    errors: Option<Array>,
    /// Whether all columns are valid; None without `check`.
    is_smooth: Option<bool>,
}

impl Linearisation {
    pub fn new(model: &Model, inner: Core) -> Self {
        let word = |mode: &ContactMode| match mode {
            ContactMode::Open => "open",
            ContactMode::Stick => "stick",
            ContactMode::Slip => "slip",
        };
        let name = |part: &Part| part.name(model).to_owned();
        let check = inner.check;
        Self {
            a: fresh_matrix(&inner.a),
            b: fresh_matrix(&inner.b),
            c: fresh_matrix(&inner.c),
            state: inner.state.into(),
            command: inner.command.into(),
            next_state: inner.next_state.into(),
            bodies: inner.parts.iter().map(name).collect(),
            modes: inner.modes.iter().map(word).collect(),
            margins: inner.margins.into(),
            is_projected: inner.is_projected,
            is_smooth: (check.as_ref()).map(|check| check.holds.iter().all(|holds| *holds)),
            holds: check.as_ref().map(|check| fresh(&check.holds)),
            errors: check.map(|check| check.errors.into()),
        }
    }
}

#[pymethods]
impl Linearisation {
    fn __repr__(&self) -> String {
        let (nx, nu, modes) = (self.state.len(), self.command.len(), &self.modes);
        let checked = self.holds.as_ref().map_or_else(String::new, |holds| {
            let broken = holds.values().iter().filter(|holds| !**holds).count();
            format!(", columns that do not hold={broken}")
        });
        format!("Linearisation(nx={nx}, nu={nu}, modes={modes:?}{checked})")
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
            LinearisationError::State(e) => e.into(),
            LinearisationError::Command(e) => e.into(),
            LinearisationError::Step(e) => e.into(),
            LinearisationError::SandNotSolved { error } => {
                Kind::Step.refusal(message, Value::Number(error))
            }
            LinearisationError::NotHeld => Kind::Step.refusal(message, Value::Nothing),
        }
    }
}

/// Parameters by their names.
pub fn named_parameters(
    sim: &RoverSimulation,
    names: Option<&Bound<'_, PyAny>>,
) -> Result<Vec<StepParameter>> {
    let Some(names) = names else {
        return Ok(Vec::new());
    };
    let names = texts(names, Kind::Option, "parameters")?;
    let soil = sim.terrain().soft().map(|layer| &**layer.soil);
    let model = sim.model();
    let find = |(i, name): (usize, &String)| {
        StepParameter::named(model, soil, name).ok_or_else(|| {
            let field = entry("parameters", Some(&i));
            let known = StepParameter::names(model, soil).join(", ");
            let message = format!("{field}: no parameter is called {name:?}; there are {known}");
            Kind::Option.error(field, message, Value::Text(name.clone()))
        })
    };
    names.iter().enumerate().map(find).collect()
}

/// Steps of trajectories with their derivatives, as `Simulation.differentiate` returns them.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct StepDerivatives {
    /// States, (n, steps + 1, nx).
    states: Array,
    /// Derivatives of each next state by the state, (n, steps, nx, nx).
    a: Array,
    /// By the command, (n, steps, nx, nu); zero for torques beyond their limit.
    b: Array,
    /// By the parameters, (n, steps, nx, n_parameters).
    c: Array,
}

impl StepDerivatives {
    pub fn new(found: &[Trajectory], steps: usize, [nx, nu, np]: [usize; 3]) -> Self {
        let n = found.len();
        let all = |part: fn(&Trajectory) -> &Vec<f64>, shape: &[usize]| {
            Array::shaped(found.iter().flat_map(part).copied().collect(), shape)
        };
        Self {
            states: all(|one| &one.states, &[n, steps + 1, nx]),
            a: all(|one| &one.a, &[n, steps, nx, nx]),
            b: all(|one| &one.b, &[n, steps, nx, nu]),
            c: all(|one| &one.c, &[n, steps, nx, np]),
        }
    }
}

#[pymethods]
impl StepDerivatives {
    fn __repr__(&self) -> String {
        format!("StepDerivatives({} trajectories)", self.states.len())
    }
}

/// The error of a trajectory, with its number and that of the step.
pub fn of_trajectory((index, error): (usize, TrajectoryError)) -> BorderError {
    let inner = BorderError::from(error.error);
    BorderError {
        message: format!("trajectory {index}, step {}: {}", error.step, inner.message),
        ..inner
    }
}
