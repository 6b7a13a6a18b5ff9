//! What the classes of all simulations do alike.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rover_core::nalgebra::DMatrix;
use rover_core::simulation::{Components, DenseOperator, LocatedContact, Scene, Simulation};

use crate::arrays::{fresh, fresh_matrix};
use crate::report::StepReport;
use crate::shared::Watch;

/// W, free velocity and friction coefficients.
pub type Problem<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Takes `n` steps with the interpreter free for others; Ctrl-C stops after a whole step.
pub fn step<S: Scene>(
    py: Python<'_>,
    simulation: &mut Simulation<S>,
    n: usize,
) -> PyResult<StepReport>
where
    Simulation<S>: Send,
{
    let mut watch = Watch::new();
    let report = py.detach(|| simulation.step_while(n, &mut || watch.go_on()));
    Ok(watch.result(report)?.into())
}

/// W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem.
pub fn problem<'py, S: Scene>(py: Python<'py>, simulation: &Simulation<S>) -> PyResult<Problem<'py>>
where
    S::Parts: DenseOperator,
{
    let (W, q, mu) = simulation.last_problem();
    let size = mu.len() * <S::Contact as LocatedContact>::Vector::N;
    let q = if size == 0 { &q[..0] } else { q };
    let W = DMatrix::from_row_slice(size, size, &W[..size * size]);
    Ok((fresh_matrix(py, &W)?, fresh(py, q), fresh(py, mu)))
}
