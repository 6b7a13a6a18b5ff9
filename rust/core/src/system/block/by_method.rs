//! A contact problem of a block, solved by any method.

use crate::problem::{Dimension, FrictionContactProblem, Redundancy, Residual};
use crate::solver::batch::problem::ContactProblem;
use crate::solver::{Method, SolveStatus, SolverOptions, SolverWorkspace, solve};

/// Scratch of these solves.
#[derive(Default)]
pub(super) struct ByMethod {
    workspace: SolverWorkspace,
    redundancy: Redundancy,
}

impl ByMethod {
    /// Solves a problem with the method of the options; after a batch, if that is `Auto`.
    pub fn solve(&mut self, problem: &mut ContactProblem, options: &SolverOptions) {
        let (W, n) = (problem.operator(), problem.n_unknowns());
        let (q, mu) = (problem.q, problem.mu);
        let (q, mu) = (&q[..n], &mu[..problem.n_contacts]);
        let stated = FrictionContactProblem::from_assembled(Dimension::Three, &W, q, mu);
        let (p, u) = (&mut problem.p[..n], &mut problem.u[..n]);
        problem.is_escalated = options.method == Method::Auto;
        let options = &SolverOptions {
            is_pivoted: problem.is_escalated,
            is_brief: problem.is_escalated,
            ..*options
        };
        let report = solve(&stated, options, p, u, &mut self.workspace);
        problem.is_acceptable = report.status == SolveStatus::Acceptable;
        problem.is_solved = report.is_converged();
        problem.residual = Residual {
            relative: report.residual,
            velocity: report.velocity_error,
        };
        if !problem.is_escalated {
            (problem.iterations, problem.factorisations, problem.pivots) = (0, 0, 0);
        }
        problem.iterations += report.iterations;
        problem.factorisations += report.factorisations();
        problem.pivots += report.pivots();
        if problem.is_solved && problem.asks_least {
            let residuals = (options.tolerance, report.residual);
            let settled = (self.redundancy).settle_problem(&stated, residuals, p, u);
            problem.residual = settled.unwrap_or(problem.residual);
        }
    }
}
