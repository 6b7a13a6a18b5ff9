//! `solve_friction_contact`: a problem from anywhere.

use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rover_core::problem::{Dimension, FrictionContactProblem};
use rover_core::solver::{Method, SolveReport, SolverOptions, SolverWorkspace, solve};

use crate::arrays::{array, fresh, vector};
use crate::errors::{BorderError, Kind, Value};

/// What a solver says of its answer.
#[pyclass(module = "rover_gym._core", frozen)]
#[derive(Clone)]
pub struct SolverReport {
    inner: SolveReport,
}

#[pymethods]
impl SolverReport {
    #[getter]
    fn status(&self) -> &'static str {
        if self.inner.is_converged() {
            "converged"
        } else {
            "not_converged"
        }
    }

    #[getter]
    fn is_converged(&self) -> bool {
        self.inner.is_converged()
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    #[getter]
    fn residual(&self) -> f64 {
        self.inner.residual
    }

    #[getter]
    fn velocity_error(&self) -> f64 {
        self.inner.velocity_error
    }

    #[getter]
    fn solver(&self) -> String {
        format!("{:?}", self.inner.method)
    }

    fn __repr__(&self) -> String {
        let (status, r) = (self.status(), &self.inner);
        format!(
            "SolverReport(status={status:?}, iterations={}, residual={:.3e})",
            r.iterations, r.residual
        )
    }
}

/// Impulses, velocities and the solver's report.
#[pyclass(module = "rover_gym._core", frozen)]
pub struct FrictionContactSolution {
    p: Vec<f64>,
    u: Vec<f64>,
    dimension: usize,
    report: SolverReport,
}

#[pymethods]
impl FrictionContactSolution {
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh(py, &self.p).reshape([self.p.len() / self.dimension, self.dimension])
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh(py, &self.u).reshape([self.u.len() / self.dimension, self.dimension])
    }

    #[getter]
    fn report(&self) -> SolverReport {
        self.report.clone()
    }
}

/// A solver by its public name.
pub fn method(name: &str) -> Result<Method, BorderError> {
    match name {
        "auto" => Ok(Method::Auto),
        "nsgs" => Ok(Method::GaussSeidel),
        "newton" => Ok(Method::Newton),
        _ => Err(BorderError::option(
            "solver",
            format!("solver: must be \"auto\", \"nsgs\" or \"newton\", is {name:?}"),
            Value::Text(name.to_owned()),
        )),
    }
}

/// Solver options of the public arguments.
pub fn solver_options(
    name: &str,
    tolerance: f64,
    max_iterations: usize,
) -> Result<SolverOptions, BorderError> {
    if !(tolerance.is_finite() && tolerance > 0.0) {
        let message = format!("tolerance: must be finite and positive, is {tolerance}");
        return Err(BorderError::option(
            "tolerance",
            message,
            Value::Number(tolerance),
        ));
    }
    if max_iterations == 0 {
        let message = "max_iterations: must be at least 1, is 0".to_owned();
        return Err(BorderError::option(
            "max_iterations",
            message,
            Value::Count(0),
        ));
    }
    Ok(SolverOptions {
        method: method(name)?,
        tolerance,
        velocity_tolerance: tolerance.max(1e-9),
        max_newton_steps: max_iterations,
        max_sweeps: max_iterations,
        ..SolverOptions::default()
    })
}

/// Solves K* contains W p + q + mu |u_T| n, perpendicular to p in K.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
#[pyo3(signature = (W, q, mu, tolerance = 1e-8, *, dimension = 3, solver = "auto", max_iterations = 1000, initial = None))]
pub fn solve_friction_contact(
    py: Python<'_>,
    W: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    mu: &Bound<'_, PyAny>,
    tolerance: f64,
    dimension: usize,
    solver: &str,
    max_iterations: usize,
    initial: Option<&Bound<'_, PyAny>>,
) -> PyResult<FrictionContactSolution> {
    let kind = match dimension {
        2 => Dimension::Two,
        3 => Dimension::Three,
        _ => {
            let message = format!("dimension: must be 2 or 3, is {dimension}");
            return Err(BorderError::option("dimension", message, Value::Count(dimension)).into());
        }
    };
    let options = solver_options(solver, tolerance, max_iterations)?;
    let W = array(W, Kind::Problem, "W")?;
    let shape = W.shape().to_vec();
    if shape.len() != 2 || shape[0] != shape[1] {
        let message = format!("W: must be square, has shape {shape:?}");
        let value = Value::Numbers(shape.iter().map(|&s| s as f64).collect());
        return Err(BorderError {
            kind: Kind::Problem,
            message,
            field: Some("W".to_owned()),
            value,
        }
        .into());
    }
    let flat = |value: &Bound<'_, PyAny>, field| -> PyResult<Vec<f64>> {
        Ok(array(value, Kind::Problem, field)?
            .as_array()
            .iter()
            .copied()
            .collect())
    };
    let W: Vec<f64> = W.as_array().iter().copied().collect();
    let q = flat(q, "q")?;
    let mu = vector(mu, Kind::Problem, "mu")?;
    let problem = FrictionContactProblem::new(kind, &W, &q, &mu).map_err(BorderError::from)?;
    let mut p = vec![0.0; q.len()];
    if let Some(initial) = initial {
        let start = flat(initial, "initial")?;
        if start.len() != p.len() || start.iter().any(|x| !x.is_finite()) {
            let message = format!("initial: needs {} finite entries", p.len());
            let (field, value) = (Some("initial".to_owned()), Value::Count(start.len()));
            return Err(BorderError {
                kind: Kind::Problem,
                message,
                field,
                value,
            }
            .into());
        }
        p = start;
    }
    let mut u = vec![0.0; q.len()];
    let inner = py.detach(|| {
        solve(
            &problem,
            &options,
            &mut p,
            &mut u,
            &mut SolverWorkspace::default(),
        )
    });
    Ok(FrictionContactSolution {
        p,
        u,
        dimension,
        report: SolverReport { inner },
    })
}
