//! `AnySimulation`: what the classes of all simulations do alike.

use std::sync::Arc;

use pyo3::prelude::*;
use rover_core::integrator::{Local, UnilateralContact};
use rover_core::nalgebra::DMatrix;
use rover_core::simulation::{AnySnapshot, DenseOperator, Scene, Simulation};

use crate::arguments::Given;
use crate::arrays::{Array, fresh, fresh_matrix};
use crate::errors::{Kind, Result};
use crate::report::{Energy, StepReport};
use crate::shared::{Open, Release, Shared, Watch};
use crate::snapshot::{KeptScene, Snapshot, other_kind, snapshot};

/// Base class of all simulations. It cannot be instantiated.
///
/// Its subclasses are `Simulation`, `PlanarSimulation`, `BedSimulation` and
/// `RoverGrainSimulation`.
///
/// Only one call may run at a time. A second call, from another thread or a signal handler, raises
/// BusyError.
#[pyclass(module = "rover_gym.core", subclass, frozen)]
pub struct AnySimulation(Arc<dyn Stepped>);

/// What is stepped from Python.
pub trait Stepped: Send + Sync {
    fn time(&self) -> Result<f64>;
    fn time_step(&self) -> Result<f64>;
    fn step(&self, py: Python<'_>, n: usize) -> Result<StepReport>;
    fn energy(&self) -> Result<Energy>;
    fn snapshot(&self) -> Result<AnySnapshot>;
    fn restore(&self, kept: &AnySnapshot) -> Result<()>;
}

impl<S: KeptScene + 'static> Stepped for Shared<Simulation<S>>
where
    Simulation<S>: Send,
{
    fn time(&self) -> Result<f64> {
        Ok(self.open()?.time())
    }

    fn time_step(&self) -> Result<f64> {
        Ok(self.open()?.options().time_step)
    }

    fn step(&self, py: Python<'_>, n: usize) -> Result<StepReport> {
        let mut held = self.open()?;
        let (inner, mut watch) = (&mut *held, Watch::new());
        let done = py.release(|| inner.step_while(n, &mut || watch.go_on()))?;
        let report = watch.result(done)?;
        Ok(StepReport::new(report, S::undetermined_loads(&held)))
    }

    fn energy(&self) -> Result<Energy> {
        Ok(self.open()?.energy().into())
    }

    fn snapshot(&self) -> Result<AnySnapshot> {
        Ok(S::keep(self.open()?.snapshot()))
    }

    fn restore(&self, kept: &AnySnapshot) -> Result<()> {
        let own = S::kept(kept).ok_or_else(other_kind)?;
        Ok(self.open()?.restore(own)?)
    }
}

impl AnySimulation {
    /// The base of a class that holds this simulation.
    pub fn base(inner: Arc<dyn Stepped>) -> PyClassInitializer<Self> {
        Self(inner).into()
    }

    /// The `repr` of a simulation: its contents, unless it is in use, and its time.
    pub fn shown(&self, class: &str, what: Result<String>) -> String {
        match (what, self.0.time()) {
            (Ok(what), Ok(time)) => format!("{class}({what}, time={time} s)"),
            (Ok(what), _) => format!("{class}({what}, stepping)"),
            _ => format!("{class}(stepping)"),
        }
    }
}

#[pymethods]
impl AnySimulation {
    /// Time since the last call of `set_state`, s; among grains, the time of the grains.
    #[getter]
    pub fn time(&self) -> Result<f64> {
        self.0.time()
    }

    /// Time step, s.
    #[getter]
    fn time_step(&self) -> Result<f64> {
        self.0.time_step()
    }

    /// Takes n steps.
    ///
    /// Other Python threads run in the meantime. Ctrl-C, or another exception of a signal handler,
    /// ends the call after the current step; the state is that after the step. If the contact
    /// solver does not converge, no exception is raised: check the report's `status`.
    ///
    /// Args:
    ///     n: Number of steps.
    ///
    /// Raises:
    ///     StepError: A step failed. The state is the one before that step.
    ///     OptionError: `n` is not a whole number from 0.
    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1)")]
    fn step(&self, py: Python<'_>, n: Given<'_>) -> Result<StepReport> {
        self.0.step(py, n.count(1, Kind::Option, "n")?)
    }

    /// Kinetic and potential energy now.
    fn energy(&self) -> Result<Energy> {
        self.0.energy()
    }

    /// Returns the complete state, from which `restore` continues bit for bit.
    pub fn snapshot(&self) -> Result<Snapshot> {
        Ok(Snapshot(self.0.snapshot()?))
    }

    /// Restores the state of a snapshot.
    ///
    /// Args:
    ///     snapshot: A snapshot of the same kind of simulation, with the same model or grains.
    ///
    /// Raises:
    ///     StateError: The snapshot is damaged, or belongs to a simulation with another model or
    ///         other grains. Nothing has changed.
    pub fn restore(&self, snapshot: &Bound<'_, PyAny>) -> Result<()> {
        self.0.restore(&self::snapshot(snapshot)?.get().0)
    }
}

/// W, free velocity and friction coefficients.
pub type Problem = (Array, Array, Array);

/// W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem.
pub fn problem<S: Scene>(simulation: &Simulation<S>) -> Problem
where
    S::Parts: DenseOperator,
{
    let (W, q, mu) = simulation.last_problem();
    let size = mu.len() * <S::Contact as UnilateralContact>::Local::N;
    let q = if size == 0 { &q[..0] } else { q };
    let W = DMatrix::from_row_slice(size, size, &W[..size * size]);
    (fresh_matrix(&W), fresh(q), fresh(mu))
}
