//! The contacts of one group as a problem of their own.

use super::report::StepReport;
use crate::problem::{FrictionContactProblem, Operator, Redundancy};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

/// Memory of the problem of a group.
#[derive(Clone, Debug, Default)]
pub(super) struct Island {
    pub contacts: Vec<usize>,
    W: Vec<f64>,
    q: Vec<f64>,
    mu: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
    /// Work of the solves of each group in this step, in the solver's unit.
    pub spent: Vec<u64>,
    /// Last solve of each group.
    answers: Vec<Option<SolveReport>>,
}

impl Island {
    /// Begins a step of a system with `n` clusters.
    pub(super) fn begin(&mut self, n: usize) {
        self.spent.clear();
        self.spent.resize(n, 0);
    }

    /// Forgets all solves.
    pub(super) fn forget_answers(&mut self) {
        self.answers.fill(None);
    }

    /// Keeps the solve of a group instead of the one before it.
    pub(super) fn keep_answer(&mut self, group: usize, solved: SolveReport) {
        if self.answers.len() <= group {
            self.answers.resize(group + 1, None);
        }
        self.answers[group] = Some(solved);
    }

    /// Enters the kept solves in a report.
    pub(super) fn enter_answers(&self, report: &mut StepReport) {
        for solved in self.answers.iter().flatten() {
            report.enter(solved);
        }
    }

    /// Solves the contacts of a group from `p`, N s, with the answer `u`, m/s. Impulses that the
    /// motion leaves open are those of least norm if there is a `redundancy`.
    pub(super) fn solve(
        &mut self,
        problem: &FrictionContactProblem<'_>,
        compliance: f64,
        options: &SolverOptions,
        [p, u]: [&mut [f64]; 2],
        workspace: &mut SolverWorkspace,
        redundancy: Option<&mut Redundancy>,
    ) -> Option<SolveReport> {
        let Operator::Dense(W) = problem.operator() else {
            return None;
        };
        let d = problem.dimension().components();
        let n = p.len();
        for vector in [&mut self.W, &mut self.q, &mut self.mu, &mut self.p] {
            vector.clear();
        }
        for &i in &self.contacts {
            self.mu.push(problem.friction_coefficients()[i]);
            self.q
                .extend_from_slice(&problem.free_velocity()[d * i..][..d]);
            self.p.extend_from_slice(&p[d * i..][..d]);
            for row in d * i..d * (i + 1) {
                for &j in &self.contacts {
                    self.W.extend_from_slice(&W[row * n + d * j..][..d]);
                }
            }
        }
        if compliance > 0.0 {
            soften(&mut self.W, compliance);
        }
        self.u.clear();
        self.u.resize(self.p.len(), 0.0);
        let dimension = problem.dimension();
        let own = FrictionContactProblem::from_assembled(dimension, &self.W, &self.q, &self.mu);
        let mut report = solve(&own, options, &mut self.p, &mut self.u, workspace);
        if let Some(redundancy) = redundancy.filter(|_| report.is_converged()) {
            let answer = (&mut self.p[..], &mut self.u[..]);
            settle(redundancy, &own, options.tolerance, &mut report, answer);
        }
        for (k, &i) in self.contacts.iter().enumerate() {
            p[d * i..][..d].copy_from_slice(&self.p[d * k..][..d]);
            u[d * i..][..d].copy_from_slice(&self.u[d * k..][..d]);
        }
        Some(report)
    }
}

/// Whether a solve is of the step's velocities or of its displacement.
#[derive(Clone, Copy, Debug)]
pub(super) enum Level {
    /// `ws.p` and `ws.u`.
    Velocity,
    /// `ws.p_position` and `ws.u_position`, on ground of a compliance relative to W's mean.
    Position(f64),
}

/// Divisor of the solver's budget for the least that each solve of a step gets, however much the
/// ones before it have spent. Of 5700 solves of heaps of 27 boxes that sweeps and Newton leave to
/// the stages after them, 30% take more than a sixteenth of it, 4% more than a quarter.
const SOLVE_SHARE: u64 = 4;

/// Budget of the next solve of a step.
pub(super) fn left_of(budget: u64, spent: u64) -> u64 {
    budget.saturating_sub(spent).max(budget / SOLVE_SHARE)
}

/// Makes the impulses of a converged answer (p, u) that the motion leaves open those of least norm.
pub(super) fn settle(
    redundancy: &mut Redundancy,
    problem: &FrictionContactProblem<'_>,
    tolerance: f64,
    solved: &mut SolveReport,
    (p, u): (&mut [f64], &mut [f64]),
) {
    let residuals = (tolerance, solved.residual);
    if let Some(residual) = redundancy.settle_problem(problem, residuals, p, u) {
        (solved.residual, solved.velocity_error) = (residual.relative, residual.velocity);
    }
}

/// Adds to the diagonal of a square matrix a share of its mean.
pub(super) fn soften(W: &mut [f64], share: f64) {
    let n = W.len().isqrt();
    let mean = (0..n).map(|i| W[i * (n + 1)]).sum::<f64>() / n as f64;
    for i in 0..n {
        W[i * (n + 1)] += share * mean;
    }
}
