//! Entry points of a solve: choose dimension, storage, units and method, then judge the answer.

use super::options::{ContactLaw, Method, SolverOptions};
use super::reference::relaxed;
use super::report::{Rung, Rungs, SolveReport, SolveStatus, Stage, StageResult};
use super::scratch::{Attempt, SolveScratch, StageEnd};
use super::stage::body_sweeps::{ContactSolution, Swept};
use super::stage::{admm, gauss_seidel, newton, proximal};
use super::strategy::auto;
use super::strategy::islands::IslandSolver;
use super::strategy::many_bodies::{self, ManyBodies};
use super::work::{SweepBudget, WorkBudget};
use super::workspace::SolverWorkspace;
use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::law::poisson_impact::Expansion;
use crate::problem::{
    BodyPairs, Dimension, FrictionContactProblem, Operator, Prepared, evaluate_into, power_of_two,
};

/// Solves `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = W p + q`.
///
/// `p` (n), N s: on entry the warm start or zeros, on return the impulses, inside the friction
/// cones up to the report's residual. `u` (n), m/s: on return `W p + q`. `workspace` may have
/// served any other problem before. It does not affect the answer in any bit, and it allocates only
/// when a problem is larger than all earlier ones.
///
/// Where several impulses solve the problem of a few contacts, a solve from `p = 0` returns the one
/// nearest to zero (Tikhonov's limit): a symmetric problem has a symmetric answer, and the order of
/// the contacts does not matter. A solve from a warm start returns the one nearest to the warm
/// start.
///
/// A solve that does not converge is no error, see [`SolveStatus`]: `p` is then the best impulse of
/// any stage. The work is bounded, see [`SolverOptions::budget`]. If `q = 0` the answer is zero,
/// whatever the warm start. Non-finite input never reaches the output: with non-finite data `p` and
/// `u` are zero and the status is [`SolveStatus::NonFinite`]; a non-finite warm start counts as
/// zeros.
///
/// # Panics
/// If the length of `p` or `u` is not the problem's number of unknowns.
pub fn solve(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    assert!(
        p.len() == problem.n_unknowns(),
        "p must have one entry per unknown"
    );
    assert!(
        u.len() == problem.n_unknowns(),
        "u must have one entry per unknown"
    );
    match problem.dimension() {
        Dimension::Two => solve_in::<2>(problem, options, p, u, workspace),
        Dimension::Three => solve_in::<3>(problem, options, p, u, workspace),
    }
}

/// Solves the contacts of very many free bodies: [`Method::Auto`] and
/// [`Method::GaussSeidel`] sweep over their pairs and need no `W`.
///
/// p, u, `workspace` and the report are as in [`solve`]. `max_sweeps` bounds the sweeps; the budget
/// bounds the stages after them. Contacts with rolling friction are swept, whatever the method.
///
/// # Panics
/// If a length does not fit.
pub fn solve_many_bodies<const D: usize>(
    bodies: &ManyBodies<'_, D>,
    options: &SolverOptions,
    answer: ContactSolution<'_>,
    workspace: &mut SolverWorkspace,
) -> SolveReport
where
    BodyPairs<D>: Swept<D>,
{
    let mut sweeps = std::mem::take(&mut workspace.body_sweeps);
    let mut solve_whole =
        |problem: &FrictionContactProblem<'_>,
         options: &SolverOptions,
         p: &mut [f64],
         u: &mut [f64]| solve(problem, options, p, u, workspace);
    let report = many_bodies::solve(bodies, options, answer, &mut sweeps, &mut solve_whole);
    workspace.body_sweeps = sweeps;
    report
}

/// Solves contacts of any [`FrictionLaw`] by sweeps, contact after contact.
///
/// `laws` (`n_c`) takes the place of the problem's coefficients. The other arguments, and the
/// report, are as in [`solve`]; the residual is the violation of these laws. Of the options the
/// tolerances, `max_sweeps` and the budget apply.
///
/// # Panics
/// If a length or the dimension does not fit.
pub fn solve_with_laws<const D: usize, L: FrictionLaw<D> + Copy>(
    problem: &FrictionContactProblem<'_>,
    laws: &[L],
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    let (n_contacts, n) = (problem.n_contacts(), problem.n_unknowns());
    assert!(
        problem.dimension().components() == D && laws.len() == n_contacts,
        "each contact must have a law of its dimension"
    );
    assert!(
        p.len() == n && u.len() == n,
        "p and u must have one entry per unknown"
    );
    if p.iter().any(|x| !x.is_finite()) {
        p.fill(0.0);
    }
    let SolverWorkspace {
        scales,
        storage,
        scratch,
        ..
    } = workspace;
    let W = storage.choose(problem, options.direct_contacts);
    scales.resize(n_contacts);
    scratch.fit(n_contacts, n, W);
    scratch.history.begin(options.keeps_history);
    scratch.start.copy_from_slice(p);
    let data = Prepared::new::<D>(problem, W, scales);
    let mut attempt = begin::<D>(&data, options, p, u, scratch);
    let budget = SweepBudget {
        sweeps: options.max_sweeps,
        predict: false,
    };
    let found = gauss_seidel::sweeps_under(&mut attempt, &|i| laws[i], budget);
    let outcome = result_of(&mut attempt, Stage::Sweeps, found);
    report_on(&mut attempt, outcome)
}

/// Solves an impact under [Poisson's law](crate::law::poisson_impact): first the compression, by
/// [`solve`], then the expansion, by [`solve_with_laws`].
///
/// The problem's q is the velocity before the impact, without a shift. `restitution` (`n_c`): e of
/// each contact, in [0, 1]. `p` (n), N s: on return the whole impulse. `u` (n), m/s: on return the
/// velocity after the impact. The report is that of the phase with the larger residual, with the
/// work of both.
///
/// # Panics
/// If a length or the dimension does not fit.
pub fn solve_poisson_impact<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    restitution: &[f64],
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    assert!(
        restitution.len() == problem.n_contacts(),
        "each contact must have a coefficient of restitution"
    );
    p.fill(0.0);
    let compressed = solve(problem, options, p, u, workspace);
    if compressed.status == SolveStatus::NonFinite {
        return compressed;
    }
    let mut given = vec![0.0; p.len()];
    for (i, e) in restitution.iter().enumerate() {
        given[D * i] = e * p[D * i];
    }
    let mut q = vec![0.0; p.len()];
    problem.operator().multiply_add(&given, u, &mut q);
    let mu = problem.friction_coefficients();
    let expansion = match problem.operator() {
        Operator::Dense(W) => {
            FrictionContactProblem::from_assembled(problem.dimension(), W, &q, mu)
        }
        Operator::BlockSparse(W) => FrictionContactProblem::from_assembled_sparse(W, &q, mu),
    };
    let laws: Vec<Expansion> = (mu.iter().zip(given.chunks_exact(D)))
        .map(|(mu, given)| Expansion {
            friction: Coulomb(*mu),
            least: given[0],
        })
        .collect();
    let mut more = vec![0.0; p.len()];
    let expanded = solve_with_laws::<D, _>(&expansion, &laws, options, &mut more, u, workspace);
    for (p, (given, more)) in p.iter_mut().zip(given.iter().zip(&more)) {
        *p += given + more;
    }
    let worse = if expanded.residual > compressed.residual || !expanded.is_converged() {
        expanded
    } else {
        compressed
    };
    SolveReport {
        iterations: compressed.iterations + expanded.iterations,
        work: compressed.work + expanded.work,
        ..worse
    }
}

/// Solves in dimension `D`, see [`solve`].
fn solve_in<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    if p.iter().any(|x| !x.is_finite()) {
        p.fill(0.0);
    }
    workspace.scratch.history.begin(options.keeps_history);
    let q = problem.free_velocity();
    if q.iter().all(|q| *q == 0.0) {
        return at_rest(problem, options.method, p, u);
    }
    let report = solve_with_scales::<D>(problem, options, p, u, workspace, false);
    match report {
        Some(report) => report,
        None => solve_scaled::<D>(problem, options, p, u, workspace),
    }
}

/// The zero answer: `p = 0` and `u = 0`.
fn at_rest(
    problem: &FrictionContactProblem<'_>,
    method: Method,
    p: &mut [f64],
    u: &mut [f64],
) -> SolveReport {
    p.fill(0.0);
    u.fill(0.0);
    let is_finite = problem
        .operator()
        .first_non_finite(problem.n_unknowns())
        .is_none();
    let status = match method.law() {
        _ if !is_finite => SolveStatus::NonFinite,
        ContactLaw::Coulomb => SolveStatus::Converged,
        ContactLaw::Relaxed => SolveStatus::SolvedRelaxed,
    };
    report_of(status, method)
}

/// The report of a solve that took no work.
fn report_of(status: SolveStatus, method: Method) -> SolveReport {
    let residual = if status == SolveStatus::NonFinite {
        f64::INFINITY
    } else {
        0.0
    };
    let mut rungs = Rungs::default();
    rungs.push(Rung {
        stage: Stage::AtRest,
        status,
        ..Rung::default()
    });
    SolveReport {
        status,
        iterations: 0,
        work: 0,
        residual,
        velocity_error: residual,
        method: match method {
            Method::Auto => Stage::AtRest.method(),
            method => method,
        },
        stage: Stage::AtRest,
        rungs,
    }
}

/// Solves the problem in the caller's units. Returns `None`, with nothing done, if `|q|` or the
/// mean diagonal of `W` is so large or small that squares overflow or vanish, unless
/// `at_any_scale`.
fn solve_with_scales<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    at_any_scale: bool,
) -> Option<SolveReport> {
    const LARGEST: f64 = 1e60;
    let SolverWorkspace {
        scales,
        storage,
        scratch,
        islands,
        nested,
        ..
    } = workspace;
    let (n_contacts, n) = (problem.n_contacts(), problem.n_unknowns());
    let W = storage.choose(problem, options.direct_contacts);
    scales.resize(n_contacts);
    scratch.fit(n_contacts, n, W);
    let data = Prepared::new::<D>(problem, W, scales);
    let is_sound = [data.inverse_speed, data.mean_diagonal]
        .iter()
        .all(|x| *x > 1.0 / LARGEST && *x < LARGEST);
    if !(is_sound || at_any_scale) {
        return None;
    }
    let mut solve_island =
        |problem: &FrictionContactProblem<'_>,
         options: &SolverOptions,
         p: &mut [f64],
         u: &mut [f64]| solve(problem, options, p, u, nested.get_or_insert_default());
    let islands = IslandSolver {
        islands,
        solve: &mut solve_island,
    };
    let mut attempt = begin::<D>(&data, options, p, u, scratch);
    let outcome = run(&mut attempt, islands);
    let mut report = report_on(&mut attempt, outcome);
    if report.status == SolveStatus::Converged && !data.is_resolved(p) {
        report.amend(SolveStatus::Stalled);
    }
    Some(report)
}

/// A solve that has spent nothing yet.
fn begin<'a, const D: usize>(
    data: &'a Prepared<'a>,
    options: &'a SolverOptions,
    p: &'a mut [f64],
    u: &'a mut [f64],
    scratch: &'a mut SolveScratch,
) -> Attempt<'a, D> {
    scratch.work = WorkBudget::new(options.budget_of(data.mu.len()));
    scratch.rungs = Rungs::default();
    Attempt {
        data,
        options,
        p,
        u,
        scratch,
        iterations: 0,
    }
}

/// Runs the method. `u` is `W p + q` on return.
fn run<const D: usize>(attempt: &mut Attempt<'_, D>, islands: IslandSolver<'_>) -> StageResult {
    let options = attempt.options;
    let (stage, found) = match options.method {
        Method::Auto => return auto::escalate(attempt, islands),
        Method::GaussSeidel => {
            let budget = SweepBudget {
                sweeps: options.max_sweeps,
                predict: false,
            };
            attempt.scratch.start.copy_from_slice(attempt.p);
            (Stage::Sweeps, gauss_seidel::sweeps(attempt, budget))
        }
        Method::Newton => {
            let steps = options.max_newton_steps;
            (Stage::Newton, newton::full_steps(attempt, steps))
        }
        Method::ProximalPoint => {
            attempt.scratch.start.copy_from_slice(attempt.p);
            let steps = options.max_newton_steps;
            (Stage::ProximalPoint, proximal::solve(attempt, steps))
        }
        Method::Admm => (Stage::Admm, admm::solve(attempt)),
        Method::Relaxed => (Stage::Relaxed, relaxed::solve(attempt)),
    };
    result_of(attempt, stage, found)
}

/// The result of the only stage of a solve.
fn result_of<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    stage: Stage,
    (status, residual): StageEnd,
) -> StageResult {
    StageResult {
        method: stage.method(),
        stage,
        status: attempt
            .scratch
            .list_stage(stage, status, attempt.iterations),
        residual,
    }
}

/// The report of a result. What is not finite becomes zero.
fn report_on<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    StageResult {
        method,
        stage,
        status,
        residual,
    }: StageResult,
) -> SolveReport {
    let iterations = attempt.iterations;
    let Attempt { p, u, scratch, .. } = attempt;
    let mut report = SolveReport {
        status,
        iterations,
        work: scratch.work.spent,
        residual: residual.relative,
        velocity_error: residual.velocity,
        method,
        stage,
        rungs: scratch.rungs,
    };
    // An infinite velocity can hide from the residual of an open contact.
    let is_finite = residual.is_finite() && p.iter().chain(u.iter()).all(|x| x.is_finite());
    if status == SolveStatus::NonFinite || !is_finite {
        refuse(&mut report, p, u);
    }
    report
}

/// The answer if the result is not finite.
fn refuse(report: &mut SolveReport, p: &mut [f64], u: &mut [f64]) {
    p.fill(0.0);
    u.fill(0.0);
    (report.residual, report.velocity_error) = (f64::INFINITY, f64::INFINITY);
    report.amend(SolveStatus::NonFinite);
}

/// Solves in units of the largest free velocity and the largest diagonal entry of `W`, both taken
/// as powers of two, so that no digit is lost.
fn solve_scaled<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    let (dimension, n, mu) = (
        problem.dimension(),
        problem.n_unknowns(),
        problem.friction_coefficients(),
    );
    let largest = |values: &mut dyn Iterator<Item = f64>| {
        power_of_two(values.fold(0.0, |m, x: f64| m.max(x.abs())))
    };
    let speed = largest(&mut problem.free_velocity().iter().copied());
    let W = problem.operator();
    let stiffness = largest(&mut (0..n).map(|k| W.diagonal(dimension, n, k / D, k % D)));
    let q: Vec<f64> = problem.free_velocity().iter().map(|x| x / speed).collect();
    let scaled_options = SolverOptions {
        velocity_tolerance: options.velocity_tolerance / speed,
        acceptable: options.acceptable / speed,
        rounding: options.rounding / speed,
        ..*options
    };
    for p in &mut *p {
        *p = *p / speed * stiffness;
    }
    let solved = match W {
        Operator::Dense(W) => {
            let W: Vec<f64> = W.iter().map(|x| x / stiffness).collect();
            let scaled = FrictionContactProblem::from_assembled(dimension, &W, &q, mu);
            solve_with_scales::<D>(&scaled, &scaled_options, p, u, workspace, true)
        }
        Operator::BlockSparse(W) => {
            let W = W.scaled(1.0 / stiffness);
            let scaled = FrictionContactProblem::from_assembled_sparse(&W, &q, mu);
            solve_with_scales::<D>(&scaled, &scaled_options, p, u, workspace, true)
        }
    };
    for p in &mut *p {
        *p = *p * speed / stiffness;
    }
    // In the caller's units the impulse may overflow or lose its digits.
    let residual = evaluate_into(problem, p, u);
    let is_finite = residual.is_finite() && p.iter().chain(&*u).all(|x| x.is_finite());
    let mut report = solved.unwrap_or_else(|| report_of(SolveStatus::NonFinite, options.method));
    if !is_finite {
        refuse(&mut report, p, u);
        return report;
    }
    let is_as_good = residual.relative <= 2.0 * report.residual.max(options.tolerance);
    (report.residual, report.velocity_error) = (residual.relative, residual.velocity);
    if report.status == SolveStatus::Converged && !is_as_good {
        report.amend(SolveStatus::Stalled);
    }
    report
}
