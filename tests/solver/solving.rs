//! Options, cold solves and comparisons that the tests share.

use crate::scenes::Problem;
use friction_contact::problem::{Dimension, FrictionContactProblem};
use friction_contact::solver::{Method, SolveReport, SolverOptions, SolverWorkspace, solve};

/// Default options with a method.
pub fn by(method: Method) -> SolverOptions {
    SolverOptions {
        method,
        ..SolverOptions::default()
    }
}

/// Default options with a method and a tolerance of the relative residual.
pub fn within(tolerance: f64, method: Method) -> SolverOptions {
    SolverOptions {
        tolerance,
        ..by(method)
    }
}

/// Impulses, velocities and report of a solve from zero.
pub fn cold(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
) -> (Vec<f64>, Vec<f64>, SolveReport) {
    let n = problem.n_unknowns();
    let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
    let mut workspace = SolverWorkspace::new();
    let report = solve(problem, options, &mut p, &mut u, &mut workspace);
    (p, u, report)
}

pub fn dimension(is_planar: bool) -> Dimension {
    if is_planar {
        Dimension::Two
    } else {
        Dimension::Three
    }
}

/// One contact with `W = w I`.
pub fn lone(w: f64, q: &[f64], mu: f64) -> Problem {
    let d = q.len();
    let mut W = vec![0.0; d * d];
    (0..d).for_each(|k| W[k * (d + 1)] = w);
    Problem {
        dimension: dimension(d == 2),
        W,
        q: q.to_vec(),
        mu: vec![mu],
    }
}

pub fn size(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
    square.sqrt()
}
