//! `solve_friction_contact`: a problem from anywhere.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::problem::{Dimension, FrictionContactProblem};
use rover_core::solver::{
    ContactLaw, Method, Rung, SolveReport, SolveStatus, SolverOptions, SolverWorkspace, solve,
};

use crate::arguments::{Given, Named, whole};
use crate::arrays::Array;
use crate::errors::{Kind, Result, Value};
use crate::given_problem::{Delassus, coefficients, flat, with_hint};
use crate::options::solver_options;

/// How the contact solver ended.
#[pyclass(module = "rover_gym.mechanics", frozen, get_all)]
#[derive(Clone)]
pub struct SolverReport {
    /// One of "converged", "relaxed", "not_converged" and "budget_exhausted".
    ///
    /// "relaxed": the convex relaxation is solved, which is not Coulomb's law. "budget_exhausted":
    /// the work that `budget` allows is done, and the answer is the best one found.
    status: &'static str,
    /// Whether Coulomb's law holds to the tolerance.
    is_converged: bool,
    /// Iterations of the stage that answered.
    iterations: usize,
    /// Violation of Signorini's and Coulomb's laws by the returned impulses, relative to the data.
    residual: f64,
    /// Largest violation of Signorini's and Coulomb's laws at one contact, m/s.
    velocity_error: f64,
    /// Name of the method that answered; never "auto".
    solver: &'static str,
    /// Name of the stage that answered; "at_rest" where q = 0 left nothing to do.
    stage: &'static str,
    /// Every stage that was tried, in order, with the reason for its end and its iterations.
    ///
    /// Reasons are "converged", "max_iterations", "stalled", "budget_exhausted", "non_finite" and
    /// "relaxed".
    stages: Vec<(&'static str, &'static str, u32)>,
    /// Work done, in the unit of the argument `budget`.
    work: u64,
    /// The law that the answer obeys, "coulomb" or "relaxed".
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
        let Self {
            status,
            stage,
            iterations,
            residual,
            ..
        } = self;
        format!(
            "SolverReport(status={status:?}, stage={stage:?}, iterations={iterations}, \
             residual={residual:.3e})"
        )
    }
}

/// The solution of a friction-contact problem.
#[pyclass(module = "rover_gym.mechanics", frozen, get_all)]
pub struct FrictionContactSolution {
    /// Impulses p, (n_c, d), N s, along the normal and the tangents.
    impulses: Array,
    /// Velocities u = W p + q, (n_c, d), m/s, along the normal and the tangents.
    velocities: Array,
    /// How the solver ended.
    report: SolverReport,
    /// The residuals measured on the way, with the argument `history`.
    ///
    /// Each is a tuple of the stage, the iterations so far and the relative residual. "nsgs" and
    /// "admm" measure every few iterations, the others at every step. Of "relaxed" it is the
    /// residual of the relaxed law.
    history: Vec<(&'static str, usize, f64)>,
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
///         addition in a product with W. None allows 3e8 units, about 0.3 s, for up to 48
///         contacts, 1.2e9 for up to 200, and more in proportion to their square beyond. What
///         exceeds the budget is left undone, and the report says so.
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
    let solver = given.text("solver", "auto")?;
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
        budget: given.read("budget", whole)?,
        keeps_history: given.flag("history", false)?,
        ..solver_options(&solver, tolerance, max_iterations, &Method::ALL)?
    };
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
    let inner = py.detach(|| solve(&problem, &options, &mut p, &mut u, &mut workspace));
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
