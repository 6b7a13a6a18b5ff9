//! What the classes of all simulations do alike.

use pyo3::prelude::*;
use rover_core::nalgebra::DMatrix;
use rover_core::simulation::{Components, DenseOperator, LocatedContact, Scene, Simulation};

use crate::arguments::count;
use crate::arrays::{Array, fresh, fresh_matrix};
use crate::errors::{Kind, Result};
use crate::report::StepReport;
use crate::shared::Watch;

/// The argument `n` of `step`: a number of steps.
pub struct Steps(pub usize);

impl FromPyObject<'_, '_> for Steps {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        Ok(Self(count(&given, Kind::Option, "n")?))
    }
}

/// W, free velocity and friction coefficients.
pub type Problem = (Array, Array, Array);

/// Takes `n` steps with the interpreter free for others; Ctrl-C stops after a whole step.
pub fn step<S: Scene>(
    py: Python<'_>,
    simulation: &mut Simulation<S>,
    Steps(n): Steps,
) -> Result<StepReport>
where
    Simulation<S>: Send,
{
    let mut watch = Watch::new();
    let report = py.detach(|| simulation.step_while(n, &mut || watch.go_on()));
    Ok(watch.result(report)?.into())
}

/// W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem.
pub fn problem<S: Scene>(simulation: &Simulation<S>) -> Problem
where
    S::Parts: DenseOperator,
{
    let (W, q, mu) = simulation.last_problem();
    let size = mu.len() * <S::Contact as LocatedContact>::Vector::N;
    let q = if size == 0 { &q[..0] } else { q };
    let W = DMatrix::from_row_slice(size, size, &W[..size * size]);
    (fresh_matrix(&W), fresh(q), fresh(mu))
}
