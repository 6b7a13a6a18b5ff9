//! Semismooth Newton on several contact problems side by side.

use super::problem::{ContactProblem, block};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::scalar::Lane;
use crate::solver::{SolverOptions, SolverWorkspace, solve};

/// Solves all problems, in lanes that take the next one when theirs is done.
///
/// # Panics
/// If a problem has more contacts than fit.
pub fn solve_all<T: Lane>(
    _token: T::Token,
    problems: &mut [ContactProblem],
    options: &SolverOptions,
) {
    let mut workspace = SolverWorkspace::new();
    for problem in problems {
        let n = problem.n_unknowns();
        let mut W = vec![0.0; n * n];
        for i in 0..problem.n_contacts {
            for j in 0..=i {
                for (k, w) in problem.W[block(i, j)].iter().enumerate() {
                    W[(3 * i + k / 3) * n + 3 * j + k % 3] = *w;
                    W[(3 * j + k % 3) * n + 3 * i + k / 3] = *w;
                }
            }
        }
        let mu = &problem.mu[..problem.n_contacts];
        let data =
            FrictionContactProblem::from_assembled(Dimension::Three, &W, &problem.q[..n], mu);
        let (p, u) = (&mut problem.p[..n], &mut problem.u[..n]);
        let report = solve(&data, options, p, u, &mut workspace);
        problem.is_solved = report.is_converged();
        problem.iterations = report.iterations;
        problem.residual = crate::problem::evaluate(&data, &problem.p[..n]);
    }
}
