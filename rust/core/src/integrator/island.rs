//! The contacts of one group as a problem of their own.

use super::mechanical_system::MechanicalSystem;
use super::report::StepReport;
use super::scratch::{ScratchOf, left_of};
use crate::problem::{FrictionContactProblem, Operator, Redundancy};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

/// Memory of the problem of a group.
#[derive(Clone, Debug, Default)]
pub(super) struct Island {
    contacts: Vec<usize>,
    W: Vec<f64>,
    q: Vec<f64>,
    mu: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
    /// Work of the solves of each group in this step, in the solver's unit.
    spent: Vec<u64>,
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
    fn solve(
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

/// Solves the contacts of a group, as [`MechanicalSystem::solve`] does those of all.
///
/// The answer is the same without the other groups. Its options are those of a problem of its size.
pub(super) fn solve_group<S: MechanicalSystem>(
    system: &S,
    options: &SolverOptions,
    ws: &mut ScratchOf<S>,
    group: usize,
    level: Level,
) -> Option<SolveReport> {
    let island = &mut ws.island;
    island.contacts.clear();
    let groups = &ws.groups;
    (island.contacts).extend((0..ws.mu.len()).filter(|&i| groups.of_contact(i) == group));
    let budget = options.budget_of(island.contacts.len());
    let spent = island.spent.get(group).copied().unwrap_or(0);
    let options = SolverOptions {
        budget: Some(left_of(budget, spent)),
        ..*options
    };
    let (p, u) = match level {
        Level::Velocity => (&mut ws.p, &mut ws.u),
        Level::Position(_) => (&mut ws.p_position, &mut ws.u_position),
    };
    let problem = system.problem(&ws.q_free, &ws.mu);
    let compliance = match level {
        Level::Velocity => 0.0,
        Level::Position(compliance) => compliance,
    };
    let is_settled =
        matches!(level, Level::Velocity) && system.open_problem(&ws.q_free, &ws.mu).is_some();
    let redundancy = is_settled.then_some(&mut ws.redundancy);
    let report = island.solve(
        &problem,
        compliance,
        &options,
        [p, u],
        &mut ws.solver,
        redundancy,
    )?;
    if let Some(own) = island.spent.get_mut(group) {
        *own += report.work;
    }
    ws.work_spent += report.work;
    Some(report)
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
