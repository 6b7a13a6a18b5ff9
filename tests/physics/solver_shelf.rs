//! The shelf's hard problems, `tests/shelf`: always tested.

mod solver_npz;

use rover_core::problem::FrictionContactProblem;
use rover_core::solver::{SolverOptions, SolverWorkspace, solve};
use solver_npz::shelf;

/// Problems that are not solved to the tolerance of 1e-8, as everything else is, and the residual that is reached.
const UNSOLVED: [(&str, f64); 2] = [("stones_460", 1e-4), ("stones_460_slow", 1e-3)];

#[test]
fn piles_of_stones_and_logs() {
    let piles = shelf(|name| name.starts_with("stones") || name.starts_with("logs"));
    assert!(!piles.is_empty());
    for pile in piles {
        let problem =
            FrictionContactProblem::new(pile.dimension, &pile.W, &pile.q, &pile.mu).expect("sound");
        let n = problem.n_unknowns();
        let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
        let report = solve(
            &problem,
            &SolverOptions {
                tolerance: 1e-8,
                ..SolverOptions::default()
            },
            &mut p,
            &mut u,
            &mut SolverWorkspace::new(),
        );
        let bound = UNSOLVED
            .iter()
            .find(|(name, _)| *name == pile.name)
            .map_or(1e-8, |(_, bound)| *bound);
        assert!(report.residual < bound, "{}: {report:?}", pile.name);
    }
}
