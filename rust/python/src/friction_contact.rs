//! `solve_friction_contact`: a problem from anywhere.

use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rover_core::problem::{Dimension, FrictionContactProblem};
use rover_core::solver::{
    ContactLaw, Iterate, Method, SolveReport, SolveStatus, SolverOptions, SolverWorkspace, solve,
};

use crate::arguments::{Given, whole};
use crate::arrays::fresh;
use crate::errors::{BorderError, Kind, Value};
use crate::given_problem::{Delassus, coefficients, flat, with_hint};

/// How the contact solver ended.
#[pyclass(module = "rover_gym.mechanics", frozen)]
#[derive(Clone)]
pub struct SolverReport {
    inner: SolveReport,
}

#[pymethods]
impl SolverReport {
    /// One of "converged", "relaxed", "not_converged" and "budget_exhausted".
    ///
    /// "relaxed": the convex relaxation is solved, which is not Coulomb's law. "budget_exhausted":
    /// the work that `budget` allows is done, and the answer is the best one found.
    #[getter]
    fn status(&self) -> &'static str {
        match self.inner.status {
            SolveStatus::Converged => "converged",
            SolveStatus::SolvedRelaxed => "relaxed",
            SolveStatus::BudgetExhausted => "budget_exhausted",
            _ => "not_converged",
        }
    }

    /// Whether Coulomb's law holds to the tolerance.
    #[getter]
    fn is_converged(&self) -> bool {
        self.inner.is_converged()
    }

    /// Iterations of the stage that answered.
    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    /// Violation of Signorini's and Coulomb's laws by the returned impulses, relative to the data.
    #[getter]
    fn residual(&self) -> f64 {
        self.inner.residual
    }

    /// Largest violation of Signorini's and Coulomb's laws at one contact, m/s.
    #[getter]
    fn velocity_error(&self) -> f64 {
        self.inner.velocity_error
    }

    /// Name of the method that answered; never "auto".
    #[getter]
    fn solver(&self) -> &'static str {
        self.inner.method.name()
    }

    /// Name of the stage that answered; "at_rest" where q = 0 left nothing to do.
    #[getter]
    fn stage(&self) -> &'static str {
        self.inner.stage.name()
    }

    /// Every stage that was tried, in order, with the reason for its end and its iterations.
    ///
    /// Reasons are "converged", "max_iterations", "stalled", "budget_exhausted", "non_finite" and
    /// "relaxed".
    #[getter]
    fn stages(&self) -> Vec<(&'static str, &'static str, u32)> {
        let rungs = self.inner.rungs.as_slice().iter();
        rungs
            .map(|rung| (rung.stage.name(), rung.status.name(), rung.iterations))
            .collect()
    }

    /// Work done, in the unit of the argument `budget`.
    #[getter]
    fn work(&self) -> u64 {
        self.inner.work
    }

    /// The law that the answer obeys, "coulomb" or "relaxed".
    #[getter]
    fn law(&self) -> &'static str {
        match self.inner.method.law() {
            ContactLaw::Coulomb => "coulomb",
            ContactLaw::Relaxed => "relaxed",
        }
    }

    fn __repr__(&self) -> String {
        let (status, r) = (self.status(), &self.inner);
        format!(
            "SolverReport(status={status:?}, stage={:?}, iterations={}, residual={:.3e})",
            r.stage.name(),
            r.iterations,
            r.residual
        )
    }
}

/// The solution of a friction-contact problem.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct FrictionContactSolution {
    p: Vec<f64>,
    u: Vec<f64>,
    dimension: usize,
    report: SolverReport,
    history: Vec<Iterate>,
}

#[pymethods]
impl FrictionContactSolution {
    /// Impulses p, (n_c, d), N s, along the normal and the tangents.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh(py, &self.p).reshape([self.p.len() / self.dimension, self.dimension])
    }

    /// Velocities u = W p + q, (n_c, d), m/s, along the normal and the tangents.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh(py, &self.u).reshape([self.u.len() / self.dimension, self.dimension])
    }

    /// How the solver ended.
    #[getter]
    fn report(&self) -> SolverReport {
        self.report.clone()
    }

    /// The residuals measured on the way, with the argument `history`.
    ///
    /// Each is a tuple of the stage, the iterations so far and the relative residual. "nsgs" and
    /// "admm" measure every few iterations, the others at every step. Of "relaxed" it is the
    /// residual of the relaxed law.
    #[getter]
    fn history(&self) -> Vec<(&'static str, usize, f64)> {
        let iterates = self.history.iter();
        iterates
            .map(|iterate| (iterate.stage.name(), iterate.iterations, iterate.residual))
            .collect()
    }
}

/// A solver by its public name, one of `known`.
fn method(name: &str, known: &[Method]) -> Result<Method, BorderError> {
    let found = known.iter().find(|method| method.name() == name);
    found.copied().ok_or_else(|| {
        let names: Vec<String> = known.iter().map(|m| format!("{:?}", m.name())).collect();
        let message = format!("solver: must be one of {}, is {name:?}", names.join(", "));
        BorderError::option("solver", message, Value::Text(name.to_owned()))
    })
}

/// What a simulation may step with: the solvers of Coulomb's law.
pub const SIMULATION_SOLVERS: [Method; 5] = [
    Method::Auto,
    Method::GaussSeidel,
    Method::Newton,
    Method::ProximalPoint,
    Method::Admm,
];

/// Solver options of the public arguments.
pub fn solver_options(
    name: &str,
    tolerance: f64,
    max_iterations: usize,
    known: &[Method],
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
        method: method(name, known)?,
        tolerance,
        velocity_tolerance: tolerance.max(1e-9),
        max_newton_steps: max_iterations,
        max_sweeps: max_iterations,
        ..SolverOptions::default()
    })
}

/// Solves the friction-contact problem K* contains W p + q + mu |u_T| n, orthogonal to p in K.
///
/// Args:
///     W: Delassus operator, (n_c d, n_c d), 1/kg, used as it is: it may be singular or
///         unsymmetric. For many contacts one of SciPy's sparse arrays, or block rows
///         `(indptr, indices, data)` of shapes (n_c + 1,), (n_blocks,), (n_blocks, d, d), each row
///         ascending and with its diagonal block.
///     q: Free velocity, (n_c d,), m/s, contact by contact: normal, tangents.
///     mu: Friction coefficients, (n_c,), or one for all contacts.
///     tolerance: Largest relative residual of a converged answer; its velocities are right to
///         max(tolerance, 1e-9) m/s as well.
///     dimension: Components d of a contact, 2 or 3.
///     solver: "auto" tries cheap methods first and robust ones last; "nsgs", "newton", "proximal"
///         and "admm" are single methods for Coulomb's law; "relaxed" solves its convex relaxation,
///         another law, and never counts as converged.
///     max_iterations: Largest number of Newton steps, sweeps or ADMM iterations.
///     initial: Impulses from which the solver starts, (n_c d,), N s; zero by default.
///     budget: Largest amount of work, counted and not timed: a unit is one multiplication and
///         addition in a product with W. None allows 3e8 units, about 0.3 s, for up to 100
///         contacts, and more in proportion to the square of the contacts. What exceeds the budget
///         is left undone, and the report says so.
///     history: Whether the solution keeps the residuals measured on the way.
///
/// Returns:
///     Impulses, velocities and the solver's report. Not converging is no error: see
///     `report.status`.
///
/// Raises:
///     ProblemError: An array has a wrong shape or an invalid entry.
///     OptionError: The solver or the dimension is unknown, or `tolerance`, `max_iterations` or
///         `budget` is out of its range.
///
/// Source: Acary and Brogliato 2008; Acary, Brémond and Huber 2018.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
#[pyo3(signature = (
    W, q, mu, tolerance = Given::MISSING, *, dimension = Given::MISSING, solver = Given::MISSING, max_iterations = Given::MISSING,
    initial = None, budget = None, history = Given::MISSING
), text_signature = "(W, q, mu, tolerance=1e-08, *, dimension=3, solver='auto', max_iterations=1000, initial=None, budget=None, history=False)")]
pub fn solve_friction_contact(
    py: Python<'_>,
    W: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    mu: &Bound<'_, PyAny>,
    tolerance: Given<'_>,
    dimension: Given<'_>,
    solver: Given<'_>,
    max_iterations: Given<'_>,
    initial: Option<&Bound<'_, PyAny>>,
    budget: Option<&Bound<'_, PyAny>>,
    history: Given<'_>,
) -> PyResult<FrictionContactSolution> {
    let option = Kind::Option;
    let tolerance = tolerance.number(1e-8, option, "tolerance")?;
    let dimension = dimension.count(3, option, "dimension")?;
    let solver = solver.text("auto", option, "solver")?;
    let max_iterations = max_iterations.count(1000, option, "max_iterations")?;
    let budget = budget.map(|given| whole(given, option, "budget"));
    let kind = match dimension {
        2 => Dimension::Two,
        3 => Dimension::Three,
        _ => {
            let message = format!("dimension: must be 2 or 3, is {dimension}");
            return Err(BorderError::option("dimension", message, Value::Count(dimension)).into());
        }
    };
    let options = SolverOptions {
        budget: budget.transpose()?,
        keeps_history: history.flag(false, option, "history")?,
        ..solver_options(&solver, tolerance, max_iterations, &Method::ALL)?
    };
    let W = Delassus::read(W, kind)?;
    let q = flat(q, "q")?;
    let mu = coefficients(mu, q.len(), dimension)?;
    let problem = match &W {
        Delassus::Dense(W) => FrictionContactProblem::new(kind, W, &q, &mu),
        Delassus::BlockSparse(W) => FrictionContactProblem::new_sparse(kind, W, &q, &mu),
    }
    .map_err(with_hint)?;
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
    let mut workspace = SolverWorkspace::default();
    let inner = py.detach(|| solve(&problem, &options, &mut p, &mut u, &mut workspace));
    Ok(FrictionContactSolution {
        p,
        u,
        dimension,
        report: SolverReport { inner },
        history: workspace.history().to_vec(),
    })
}
