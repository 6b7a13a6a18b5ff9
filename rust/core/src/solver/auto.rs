//! The choice of method, and what all methods share: prepared scales, the acceptance test, the final report.

use super::methods::{Algorithm, ContactLaw, Outcome};
use super::nsgs::Budget;
use super::report::{Rungs, SolveReport, SolveStatus, Stage};
use super::work::Work;
use super::workspace::SolverWorkspace;
use super::{
    Method, SolverOptions, admm, guided, islands, newton, nsgs, pivoting, proximal, restarts, work,
};
use crate::law::coulomb::{natural_map, violation};
use crate::problem::{
    ContactScales, FrictionContactProblem, Magnitudes, Operator, Residual, Violations,
    evaluate_contact, evaluate_into, power_of_two,
};

/// Friction coefficient from which the natural map is no measure of progress.
const STEEP: f64 = 1e3;

/// Largest rounding of `W p`, relative to `|q|`, of an answer that counts as converged.
const RESOLVED: f64 = 1e-6;

/// The problem's slices and the scales derived from them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepared<'a> {
    /// Delassus operator, 1/kg.
    pub W: Operator<'a>,
    /// Free velocity (n), m/s.
    pub q: &'a [f64],
    /// Friction coefficients.
    pub mu: &'a [f64],
    /// Number of unknowns.
    pub n: usize,
    /// Mean diagonal entry of `W`, 1/kg; 1 if not positive.
    pub mean_diagonal: f64,
    /// Work of one product with `W`.
    pub product: u64,
    /// `1/|q|`, 0 if `q = 0`.
    pub inverse_speed: f64,
    /// `1/|(ρ_i q_i)|`, 1 if `q = 0`.
    pub inverse_data: f64,
}

impl<'a> Prepared<'a> {
    fn new<const D: usize>(
        problem: &FrictionContactProblem<'a>,
        W: Operator<'a>,
        workspace: &mut SolverWorkspace,
    ) -> Self {
        let dimension = problem.dimension();
        let (q, mu, n) = (
            problem.free_velocity(),
            problem.friction_coefficients(),
            problem.n_unknowns(),
        );
        let mut trace = 0.0;
        let mut data = Magnitudes::default();
        for (i, q) in q.chunks_exact(D).enumerate() {
            let normal = W.diagonal(dimension, n, i, 0);
            let mut tangential = 0.0;
            for k in 1..D {
                tangential += W.diagonal(dimension, n, i, k);
            }
            trace += normal + tangential;
            let scales = ContactScales::new::<D>(normal, tangential);
            workspace.rho[i] = scales.mass;
            workspace.rho_modes[i] = scales.modes;
            data.add(q, scales.mass);
        }
        let mean = trace / n.max(1) as f64;
        let [inverse_speed, inverse_data] = data.inverses();
        Self {
            W,
            q,
            mu,
            n,
            mean_diagonal: if mean > 0.0 && mean.is_finite() {
                mean
            } else {
                1.0
            },
            product: work::product(W, n),
            inverse_speed,
            inverse_data,
        }
    }

    /// Diagonal block of contact `i`, 1/kg.
    #[inline]
    pub fn block<const D: usize>(&self, i: usize) -> [[f64; D]; D] {
        self.W.block(self.n, i)
    }

    /// Residual of `(p, u)`; the same numbers as [`crate::problem::evaluate`], with the scales already at hand.
    #[inline]
    pub fn measure<const D: usize>(
        &self,
        workspace: &SolverWorkspace,
        p: &[f64],
        u: &[f64],
    ) -> Residual {
        let mut violations = Violations::default();
        let scales = workspace.rho.iter().zip(&workspace.rho_modes);
        for (i, (&mu, (&mass, &modes))) in self.mu.iter().zip(scales).enumerate() {
            violations.add(evaluate_contact::<D>(p, u, D * i, mu, modes), mass);
        }
        violations.residual(self.inverse_speed, self.inverse_data)
    }

    /// What a damped step has to make smaller, for the regularised problem (`W + α I`, `q − α c`) at `(p, u)`, `u = W p + q`: the squared natural map, in
    /// (N s)², or the violation itself where μ leaves the map no digits. Measured on piles of 460 contacts: with the map a tenth to a third fewer steps.
    pub fn merit<const D: usize>(
        &self,
        workspace: &SolverWorkspace,
        alpha: f64,
        p: &[f64],
        u: &[f64],
    ) -> f64 {
        let (mut sum, centre) = (0.0, &workspace.centre);
        let scales = workspace.rho.iter().zip(&workspace.rho_modes);
        for (i, (&mu, (&mass, &modes))) in self.mu.iter().zip(scales).enumerate() {
            let p_i: [f64; D] = std::array::from_fn(|k| p[D * i + k]);
            let u_hat =
                std::array::from_fn(|k| u[D * i + k] + alpha * (p_i[k] - centre[D * i + k]));
            let squares = |map: [f64; D]| map.iter().map(|x| x * x).sum::<f64>();
            sum += if mu <= STEEP {
                squares(natural_map(&p_i, &u_hat, mu, mass))
            } else {
                (mass * mass) * squares(violation(&p_i, &u_hat, mu, modes))
            };
        }
        sum
    }

    /// Whether both tolerances hold.
    #[inline]
    pub fn accepts(options: &SolverOptions, residual: Residual) -> bool {
        residual.relative <= options.tolerance && residual.velocity <= options.velocity_tolerance
    }

    /// Whether the rounding of `W p` is small beside the free velocity, so that the velocities of `p` mean something. At mass ratios of about
    /// 1e10 they need not.
    pub fn is_resolved(&self, p: &[f64]) -> bool {
        let allowed = RESOLVED / self.inverse_speed;
        let largest = p.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let bound = self.mean_diagonal * (self.n * self.n) as f64 * largest;
        f64::EPSILON * bound <= allowed
            || (0..self.n).all(|r| f64::EPSILON * self.W.row_magnitude(r, p) <= allowed)
    }

    /// Whether each contact's violation is within the rounding of its own rows of `W p + q`: then no impulse does better.
    pub fn is_within_rounding<const D: usize>(
        &self,
        workspace: &SolverWorkspace,
        p: &[f64],
        u: &[f64],
    ) -> bool {
        let contacts = self.mu.iter().zip(&workspace.rho_modes);
        contacts.enumerate().all(|(i, (&mu, &modes))| {
            let violation = evaluate_contact::<D>(p, u, D * i, mu, modes).sqrt();
            let size: f64 = (D * i..D * (i + 1))
                .map(|r| self.W.row_magnitude(r, p) + self.q[r].abs())
                .sum();
            violation <= 4.0 * f64::EPSILON * size
        })
    }
}

/// Solves in dimension `D`, see [`solve`](super::solve).
pub(super) fn solve_in<A: Algorithm, const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    if p.iter().any(|x| !x.is_finite()) {
        p.fill(0.0);
    }
    let q = problem.free_velocity();
    if q.iter().all(|q| *q == 0.0) {
        return at_rest::<A>(problem, p, u);
    }
    let report = solve_with_scales::<A, D>(problem, options, p, u, workspace, false);
    match report {
        Some(report) => report,
        None => solve_scaled::<A, D>(problem, options, p, u, workspace),
    }
}

/// Nothing moves and nothing is pushed: `p = 0` and `u = 0`.
fn at_rest<A: Algorithm>(
    problem: &FrictionContactProblem<'_>,
    p: &mut [f64],
    u: &mut [f64],
) -> SolveReport {
    p.fill(0.0);
    u.fill(0.0);
    let is_finite = problem
        .operator()
        .first_non_finite(problem.n_unknowns())
        .is_none();
    let status = match A::METHOD.law() {
        _ if !is_finite => SolveStatus::NonFinite,
        ContactLaw::Coulomb => SolveStatus::Converged,
        ContactLaw::Relaxed => SolveStatus::SolvedRelaxed,
    };
    let method = match A::METHOD {
        Method::Auto => Method::Newton,
        method => method,
    };
    SolveReport {
        status,
        ..report_of(if is_finite { 0.0 } else { f64::INFINITY }, method)
    }
}

/// A report of no work at all, with this residual.
fn report_of(residual: f64, method: Method) -> SolveReport {
    SolveReport {
        status: SolveStatus::NonFinite,
        iterations: 0,
        work: 0,
        residual,
        velocity_error: residual,
        method,
        stage: Stage::AtRest,
        rungs: Rungs::default(),
    }
}

/// Solves the problem as it is; `None`, and nothing done, where `|q|` or the mean diagonal of `W` is so large or small that squares
/// overflow or vanish, unless `at_any_scale`.
fn solve_with_scales<A: Algorithm, const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    at_any_scale: bool,
) -> Option<SolveReport> {
    const LARGEST: f64 = 1e60;
    let (n_contacts, n) = (problem.n_contacts(), problem.n_unknowns());
    let is_sound = |data: &Prepared<'_>| {
        let scales = [data.inverse_speed, data.mean_diagonal];
        at_any_scale || scales.iter().all(|x| *x > 1.0 / LARGEST && *x < LARGEST)
    };
    if let W @ Operator::Dense(_) = problem.operator()
        && n_contacts <= options.direct_contacts
    {
        workspace.fit(n_contacts, n, W);
        let data = Prepared::new::<D>(problem, W, workspace);
        return is_sound(&data).then(|| judge::<A, D>(&data, options, p, u, workspace));
    }
    // Taken out of the workspace while the solve borrows it.
    let mut storage = std::mem::take(&mut workspace.storage);
    let W = storage.choose(problem, options.direct_contacts);
    workspace.fit(n_contacts, n, W);
    let data = Prepared::new::<D>(problem, W, workspace);
    let report = is_sound(&data).then(|| judge::<A, D>(&data, options, p, u, workspace));
    workspace.storage = storage;
    report
}

/// Solves in units of the largest free velocity and the largest diagonal entry of `W`, both taken as powers of two, so that no digit is lost.
fn solve_scaled<A: Algorithm, const D: usize>(
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
        ..*options
    };
    for p in &mut *p {
        *p = *p / speed * stiffness;
    }
    let solved = match W {
        Operator::Dense(W) => {
            let W: Vec<f64> = W.iter().map(|x| x / stiffness).collect();
            let scaled = FrictionContactProblem::from_assembled(dimension, &W, &q, mu);
            solve_with_scales::<A, D>(&scaled, &scaled_options, p, u, workspace, true)
        }
        Operator::BlockSparse(W) => {
            let W = W.scaled(1.0 / stiffness);
            let scaled = FrictionContactProblem::from_assembled_sparse(&W, &q, mu);
            solve_with_scales::<A, D>(&scaled, &scaled_options, p, u, workspace, true)
        }
    };
    for p in &mut *p {
        *p = *p * speed / stiffness;
    }
    // In the caller's units the impulse may overflow or lose its digits.
    let residual = evaluate_into(problem, p, u);
    let is_finite = residual.is_finite() && p.iter().chain(&*u).all(|x| x.is_finite());
    match solved {
        Some(report) if is_finite => SolveReport {
            status: match report.status {
                SolveStatus::Converged
                    if residual.relative > 2.0 * report.residual.max(options.tolerance) =>
                {
                    SolveStatus::Stalled
                }
                status => status,
            },
            residual: residual.relative,
            velocity_error: residual.velocity,
            ..report
        },
        _ => {
            p.fill(0.0);
            u.fill(0.0);
            SolveReport {
                status: SolveStatus::NonFinite,
                residual: f64::INFINITY,
                velocity_error: f64::INFINITY,
                ..solved.unwrap_or_else(|| report_of(f64::INFINITY, A::METHOD))
            }
        }
    }
}

/// Runs the method and judges what it returns.
fn judge<A: Algorithm, const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    let mut iterations = 0;
    workspace.work = Work::new(options.budget);
    workspace.rungs = Rungs::default();
    let outcome = A::run::<D>(data, options, p, u, workspace, &mut iterations);
    let Outcome {
        method,
        stage,
        status,
        residual,
    } = outcome;
    let report = SolveReport {
        status,
        iterations,
        work: workspace.work.spent,
        residual: residual.relative,
        velocity_error: residual.velocity,
        method,
        stage,
        rungs: workspace.rungs,
    };
    // An infinite velocity can hide from the residual of an open contact.
    let is_finite = residual.is_finite() && p.iter().chain(u.iter()).all(|x| x.is_finite());
    if status == SolveStatus::NonFinite || !is_finite {
        p.fill(0.0);
        u.fill(0.0);
        return SolveReport {
            status: SolveStatus::NonFinite,
            residual: f64::INFINITY,
            velocity_error: f64::INFINITY,
            ..report
        };
    }
    if status == SolveStatus::Converged && !data.is_resolved(p) {
        return SolveReport {
            status: SolveStatus::Stalled,
            ..report
        };
    }
    report
}

/// Most sweeps over many contacts before Newton. Dense, a Newton step costs about as much as `n` sweeps; block-sparse the fill grows with the problem; 20, 50 and 200 were
/// tried on the recorded ones.
fn sweep_budget(data: &Prepared<'_>) -> usize {
    match data.W {
        Operator::Dense(_) => 2 * data.n,
        Operator::BlockSparse(_) => (data.mu.len() / 20).max(50),
    }
}

/// Alternations that bring many contacts near enough for the proximal point: on piles of 250 and 460 contacts it then takes a third to five sixths of the steps.
const ALTERNATIONS: usize = 300;

/// Residual below which few contacts are worth the proximal point once more, from the nearest answer. Problems without an answer mostly stay above.
const NEAR: f64 = 1e-4;

/// The stages of [`Method::Auto`] so far: what each came to, and the nearest answer.
struct Ladder<'a> {
    options: &'a SolverOptions,
    /// Iterations before the present stage.
    before: usize,
    /// The nearest answer, whose impulse is in the workspace.
    nearest: Outcome,
}

impl<'a> Ladder<'a> {
    fn new(options: &'a SolverOptions) -> Self {
        Self {
            options,
            before: 0,
            nearest: Outcome {
                method: Method::Newton,
                stage: Stage::AtRest,
                status: SolveStatus::Stalled,
                residual: Residual::UNSOLVED,
            },
        }
    }

    /// Enters a stage that ended with `p`; an outcome if it is the answer.
    #[inline]
    fn enter(
        &mut self,
        (method, stage): (Method, Stage),
        (status, residual): (SolveStatus, Residual),
        p: &[f64],
        workspace: &mut SolverWorkspace,
        iterations: usize,
    ) -> Option<Outcome> {
        let status = workspace.list_stage(stage, status, iterations - self.before);
        self.before = iterations;
        let outcome = Outcome {
            method,
            stage,
            status,
            residual,
        };
        if status == SolveStatus::Converged {
            return Some(outcome);
        }
        let is_nearer =
            excess(self.options, residual) < excess(self.options, self.nearest.residual);
        if is_nearer {
            self.nearest = outcome;
            workspace.nearest.copy_from_slice(p);
        }
        None
    }

    /// Ends with the nearest answer, for the reason of the last stage. `u` is `W p + q` on return.
    fn give_nearest<const D: usize>(
        self,
        data: &Prepared<'_>,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &SolverWorkspace,
    ) -> Outcome {
        if !self.nearest.residual.is_finite() {
            return Outcome {
                status: SolveStatus::NonFinite,
                ..self.nearest
            };
        }
        p.copy_from_slice(&workspace.nearest);
        data.W.multiply_add(p, data.q, u);
        Outcome {
            status: workspace
                .rungs
                .as_slice()
                .last()
                .map_or(self.nearest.status, |rung| rung.status),
            residual: data.measure::<D>(workspace, p, u),
            ..self.nearest
        }
    }
}

/// How far a residual is above the tolerances, as a factor.
fn excess(options: &SolverOptions, residual: Residual) -> f64 {
    (residual.relative / options.tolerance).max(residual.velocity / options.velocity_tolerance)
}

/// [`Method::Auto`]: what is cheap first, what is robust last.
pub(super) fn escalate<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> Outcome {
    let mut ladder = Ladder::new(options);
    workspace.start.copy_from_slice(p);
    let steps = newton::FULL_STEPS.min(options.max_newton_steps);
    let is_few = data.mu.len() <= options.direct_contacts;
    let is_warm = p.iter().any(|x| x.abs() > 0.0);
    if !is_few {
        let budget = Budget {
            sweeps: sweep_budget(data),
            predict: true,
        };
        let found = nsgs::sweeps::<D>(data, options, budget, p, u, workspace, iterations);
        let stage = (Method::GaussSeidel, Stage::Sweeps);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        if found.0 == SolveStatus::NonFinite {
            return ladder.give_nearest::<D>(data, p, u, workspace);
        }
        if let Operator::BlockSparse(W) = data.W
            && let Some(found) = islands::solve::<D>(data, W, options, p, u, workspace, iterations)
        {
            let stage = (found.method, Stage::Islands);
            let found = (found.status, found.residual);
            if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
                return outcome;
            }
        }
        workspace.start.copy_from_slice(p);
    } else if is_warm {
        // Where the modes of the last step serve, this is the end; where they do not, more full steps seldom help.
        let few = newton::WARM_STEPS.min(steps);
        let found = newton::full_steps::<D>(data, options, few, p, u, workspace, iterations);
        let stage = (Method::Newton, Stage::WarmNewton);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        p.copy_from_slice(&workspace.start);
        let found = pivoting::pivots::<D>(data, options, p, u, workspace, iterations);
        let stage = (Method::Newton, Stage::Pivoting);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        // A warm start can mislead where zero does not.
        p.fill(0.0);
    } else if data.q.chunks_exact(D).any(|q| q[0] < 0.0) {
        let found = match guided::solve::<D>(data, options, p, u, workspace, iterations) {
            Some(residual) => (SolveStatus::Converged, residual),
            None => (SolveStatus::Stalled, Residual::UNSOLVED),
        };
        let stage = (Method::Newton, Stage::GuidedNewton);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        p.fill(0.0);
    }
    let found = newton::full_steps::<D>(data, options, steps, p, u, workspace, iterations);
    let stage = (Method::Newton, Stage::Newton);
    if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
        return outcome;
    }
    p.copy_from_slice(&workspace.start);
    if !is_few {
        let own = SolverOptions {
            max_sweeps: ALTERNATIONS.min(options.max_sweeps),
            ..*options
        };
        let law = ContactLaw::Coulomb;
        let found = admm::solve::<D>(data, &own, law, p, u, workspace, iterations);
        let stage = (Method::Admm, Stage::Admm);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        if ladder.nearest.stage != Stage::Admm {
            p.copy_from_slice(&workspace.start);
        }
    }
    let found = proximal::solve::<D>(data, options, p, u, workspace, iterations);
    let stage = (Method::ProximalPoint, Stage::ProximalPoint);
    if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
        return outcome;
    }
    if is_few && ladder.nearest.residual.is_finite() {
        let found = restarts::solve::<D>(data, options, p, u, workspace, iterations);
        let stage = (Method::Newton, Stage::Restarts);
        if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
            return outcome;
        }
        if ladder.nearest.residual.relative < NEAR {
            p.copy_from_slice(&workspace.nearest);
            let found = proximal::solve::<D>(data, options, p, u, workspace, iterations);
            let stage = (Method::ProximalPoint, Stage::ProximalPoint);
            if let Some(outcome) = ladder.enter(stage, found, p, workspace, *iterations) {
                return outcome;
            }
        }
    }
    ladder.give_nearest::<D>(data, p, u, workspace)
}
