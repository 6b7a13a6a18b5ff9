//! `Linearisation`: the derivatives of a step.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rover_core::contact::Part;
use rover_core::integrator::ContactMode;
use rover_core::multibody::Model;
use rover_core::simulation::{Linearisation as Core, LinearisationError};

use crate::arrays::{fresh, fresh_matrix};
use crate::errors::{BorderError, Kind, Value};

/// Derivatives of a time step by state and command, as `Simulation.linearise` returns them.
///
/// `x_next = next_state + a @ (x - state) + b @ (u - command)` to first order. The state is
/// x = (q, v) as `Simulation.q` and `Simulation.v` return them, the command is u = (wheel torques,
/// steering set-points). All arrays are new.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Linearisation {
    inner: Core,
    bodies: Vec<String>,
}

impl Linearisation {
    pub fn new(model: &Model, inner: Core) -> Self {
        let name = |part: &Part| part.name(model).to_owned();
        Self {
            bodies: inner.parts.iter().map(name).collect(),
            inner,
        }
    }
}

fn word(mode: ContactMode) -> &'static str {
    match mode {
        ContactMode::Open => "open",
        ContactMode::Stick => "stick",
        ContactMode::Slip => "slip",
    }
}

#[pymethods]
impl Linearisation {
    /// Derivative of the next state by the state, (nx, nx) with nx = 2 nv.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh_matrix(py, &self.inner.a)
    }

    /// Derivative of the next state by the command, (nx, nu) with nu = 2 n_wheels.
    ///
    /// Columns of wheels without a drive or without steering are 0.
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh_matrix(py, &self.inner.b)
    }

    /// State before the step, (nx,).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, &self.inner.state)
    }

    /// Command of the step, (nu,).
    #[getter]
    fn command<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, &self.inner.command)
    }

    /// State after the step, (nx,).
    #[getter]
    fn next_state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, &self.inner.next_state)
    }

    /// Names of the solids that touch in the step, and of the joints at a stop, one a contact.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.bodies.clone()
    }

    /// Mode of each contact, "open", "stick" or "slip".
    ///
    /// An open contact transmits no impulse. A contact without friction is "slip" while closed.
    #[getter]
    fn modes(&self) -> Vec<&'static str> {
        self.inner.modes.iter().map(|mode| word(*mode)).collect()
    }

    /// How far each contact is from another mode, (n,), m/s; rad/s at a joint's stop.
    ///
    /// It is the normal velocity of an open contact. Of a closed one it is the smaller of its
    /// normal impulse and, sticking, of mu p_N - |p_T|, both times the inverse effective mass along
    /// the normal, or, slipping, of the sliding speed.
    #[getter]
    fn margins<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, &self.inner.margins)
    }

    /// Whether the step moves bodies out of penetration; the derivative contains it then.
    #[getter]
    fn is_projected(&self) -> bool {
        self.inner.is_projected
    }

    /// Whether nothing jumps within the tested changes of each entry of (x, u), (nx + nu,).
    ///
    /// Two steps, ahead and back, have the same closed contacts in the same modes, are projected
    /// and corrected by the energy audit as this step is, and agree with the column within 1%.
    #[getter]
    fn holds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.inner.holds)
    }

    /// Difference of each column of (a, b) from that of its two tested steps, (nx + nu,).
    ///
    /// It is the largest difference of an entry, relative to the column's largest entry.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, &self.inner.errors)
    }

    /// Whether every column holds.
    #[getter]
    fn is_smooth(&self) -> bool {
        self.inner.holds.iter().all(|holds| *holds)
    }

    fn __repr__(&self) -> String {
        let (nx, nu) = self.inner.b.shape();
        let broken = self.inner.holds.iter().filter(|holds| !**holds).count();
        let modes: Vec<_> = self.modes();
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
                Self::option("variant", message, Value::Text("newton".to_owned()))
            }
            LinearisationError::Perturbation { value } => {
                Self::option("perturbation", message, Value::Number(value))
            }
            LinearisationError::Singular { index, pitch } => Self {
                kind: Kind::State,
                message,
                field: Some(format!("q[{index}]")),
                value: Value::Number(pitch),
            },
            LinearisationError::Step(e) => e.into(),
            LinearisationError::NotHeld => Self {
                kind: Kind::Step,
                message,
                field: None,
                value: Value::Nothing,
            },
        }
    }
}
