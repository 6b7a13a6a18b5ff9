//! `solve_friction_contact`: a problem from anywhere.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::problem::{Dimension, FrictionContactProblem};
use rover_core::solver::{
    ContactLaw, Rung, SolveReport, SolveStatus, SolverOptions, SolverWorkspace, solve,
};

use crate::arguments::{Given, Named, text, whole};
use crate::arrays::Array;
use crate::errors::{Kind, Result, Value};
use crate::given_problem::{Delassus, coefficients, flat, with_hint};
use crate::options::{METHODS, checked, choice};
use crate::shared::Release;

/// Result report of the contact solver.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
#[derive(Clone)]
pub struct SolverReport {
    /// Outcome of the solve, "converged", "relaxed", "not_converged" or "budget_exhausted".
    ///
    /// "relaxed": the convex relaxation is solved, which differs from Coulomb's law.
    /// "budget_exhausted": the `budget` is spent, and the best solution found is returned.
    status: &'static str,
    /// Whether Coulomb's law holds to the tolerance.
    is_converged: bool,
    /// Iterations of the stage that found the solution.
    iterations: usize,
    /// Violation of Signorini's and Coulomb's laws by the impulses, relative to the data.
    residual: f64,
    /// Largest violation of Signorini's and Coulomb's laws at one contact, m/s.
    velocity_error: f64,
    /// Name of the method that found the solution; never "auto".
    solver: &'static str,
    /// Name of the stage that found the solution; "at_rest" if q = 0 needed none.
    stage: &'static str,
    /// All stages tried, in order, each with the reason why it ended and its iterations.
    ///
    /// Reasons are "converged", "max_iterations", "stalled", "budget_exhausted", "non_finite" and
    /// "relaxed".
    stages: Vec<(&'static str, &'static str, u32)>,
    /// Work done, in the unit of the argument `budget`.
    work: u64,
    /// The friction law of the solution, "coulomb" or "relaxed".
    law: &'static str,
}

impl From<SolveReport> for SolverReport {
    fn from(inner: SolveReport) -> Self {
        let rungs = inner.rungs.as_slice().iter();
        let rung = |rung: &Rung| (rung.stage.name(), rung.status.name(), rung.iterations);
        Self {
            status: match inner.status {
                SolveStatus::Converged => "converged",
                SolveStatus::SolvedRelaxed => "relaxed",
                SolveStatus::BudgetExhausted => "budget_exhausted",
                _ => "not_converged",
            },
            is_converged: inner.is_converged(),
            iterations: inner.iterations,
            residual: inner.residual,
            velocity_error: inner.velocity_error,
            solver: inner.method.name(),
            stage: inner.stage.name(),
            stages: rungs.map(rung).collect(),
            work: inner.work,
            law: match inner.method.law() {
                ContactLaw::Coulomb => "coulomb",
                ContactLaw::Relaxed => "relaxed",
            },
        }
    }
}

#[pymethods]
impl SolverReport {
    fn __repr__(&self) -> String {
        format!(
            "SolverReport(status={:?}, stage={:?}, iterations={}, residual={:.3e})",
            self.status, self.stage, self.iterations, self.residual
        )
    }
}

/// The solution of a friction-contact problem.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct FrictionContactSolution {
    /// Impulses p, (n_c, d), N s, along the normal and the tangents.
    impulses: Array,
    /// Velocities u = W p + q, (n_c, d), m/s, along the normal and the tangents.
    velocities: Array,
    /// Report of the solver.
    report: SolverReport,
    /// Residuals during the iterations; empty without the argument `history`.
    ///
    /// Each entry is a tuple of the stage, the number of iterations and the relative residual.
    /// "nsgs" and "admm" measure it every few iterations, the other methods in every iteration. For
    /// "relaxed" it is the residual of the relaxed law.
    history: Vec<(&'static str, usize, f64)>,
}

/// Solves the friction-contact problem K* contains W p + q + mu |u_T| n, orthogonal to p in K.
///
/// Args:
///     W: Delassus operator, (n_c d, n_c d), 1/kg. It may be singular or unsymmetric. For many
///         contacts, give a SciPy sparse array, or block rows `(indptr, indices, data)` of shapes
///         (n_c + 1,), (n_blocks,), (n_blocks, d, d), with ascending columns and the diagonal block
///         in each row.
///     q: Free velocity, (n_c d,), m/s, contact by contact: normal, tangents.
///     mu: Friction coefficients, (n_c,), or one for all contacts.
///     tolerance: Largest relative residual of a converged solution. Errors of its velocities are
///         at most max(tolerance, 1e-9) m/s as well.
///     dimension: Components d of a contact, 2 or 3.
///     solver: "auto" tries cheap methods first and robust ones last; "nsgs", "newton", "proximal"
///         and "admm" are single methods for Coulomb's law; "relaxed" solves the convex relaxation,
///         which is another law, and its status is never "converged".
///     max_iterations: Largest number of Newton steps, sweeps or ADMM iterations.
///     initial: Impulses from which the solver starts, (n_c d,), N s; zero by default.
///     budget: Largest amount of work, in operations rather than time: a unit is one multiplication
///         and addition in a product with W. The default is 3e8 units, about 0.3 s, for up to 64
///         contacts, 1.2e9 for up to 200, and proportional to the square of their number beyond.
///         When the budget is spent, the solver stops with the status "budget_exhausted".
///     history: Whether to record the residuals of the iterations.
///
/// Returns:
///     Impulses, velocities and the solver's report. If the solver does not converge, no exception
///     is raised: check `report.status`.
///
/// Raises:
///     ProblemError: An array has a wrong shape or an invalid entry.
///     OptionError: The solver or the dimension is unknown, or `tolerance`, `max_iterations` or
///         `budget` is out of its range.
///
/// Source: Acary and Brogliato 2008; Acary, Brémond and Huber 2018.
#[pyfunction]
#[pyo3(signature = (W, q, mu, tolerance = Given::MISSING, **options), text_signature = "(W, q, mu, tolerance=1e-08, *, dimension=3, solver='auto', max_iterations=1000, initial=None, budget=None, history=False)")]
pub fn solve_friction_contact(
    py: Python<'_>,
    W: &Bound<'_, PyAny>,
    q: &Bound<'_, PyAny>,
    mu: &Bound<'_, PyAny>,
    tolerance: Given<'_>,
    options: Option<&Bound<'_, PyDict>>,
) -> Result<FrictionContactSolution> {
    let given = Named::keywords(py, options)?;
    let tolerance = tolerance.number(1e-8, Kind::Option, "tolerance")?;
    let dimension = given.count("dimension", 3)?;
    let solver = match given.get("solver")?.given() {
        Some(solver) => text(&solver, Kind::Option, "solver")?,
        None => "auto".to_owned(),
    };
    let max_iterations = given.count("max_iterations", 1000)?;
    let kind = match dimension {
        2 => Dimension::Two,
        3 => Dimension::Three,
        _ => {
            let message = format!("dimension: must be 2 or 3, is {dimension}");
            return Err(Kind::Option.error("dimension", message, Value::Count(dimension)));
        }
    };
    let options = SolverOptions {
        method: choice("solver", &solver, &METHODS)?,
        tolerance,
        max_sweeps: max_iterations,
        budget: given.read("budget", whole)?,
        keeps_history: given.flag("history", false)?,
        ..SolverOptions::default()
    };
    let options = checked(options)?;
    let initial = given.some("initial")?;
    given.finish()?;
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
        let start = flat(&initial, "initial")?;
        if start.len() != p.len() || start.iter().any(|x| !x.is_finite()) {
            let message = format!("initial: needs {} finite entries", p.len());
            return Err(Kind::Problem.error("initial", message, Value::Count(start.len())));
        }
        p = start;
    }
    let mut u = vec![0.0; q.len()];
    let mut workspace = SolverWorkspace::default();
    let inner = py.release(|| solve(&problem, &options, &mut p, &mut u, &mut workspace))?;
    let shape = [mu.len(), dimension];
    let iterates = workspace.history().iter();
    Ok(FrictionContactSolution {
        impulses: Array::shaped(p, &shape),
        velocities: Array::shaped(u, &shape),
        report: inner.into(),
        history: iterates
            .map(|one| (one.stage.name(), one.iterations, one.residual))
            .collect(),
    })
}
