//! The recorded friction-contact problems: Siconos' public collection and synthetic ones with hard mass ratios.
//!
//! They lie outside the repository; where they are absent the tests say so and pass. The full table, with times, is
//! `cargo run --release --example solver_table`.

mod solver_npz;

use rover_core::problem::FrictionContactProblem;
use rover_core::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};
use solver_npz::{Recorded, recorded};

/// Largest iteration count of each problem, sweeps and linear solves together, a snapshot; what is not listed may take 60.
const ITERATIONS: [(&str, usize); 11] = [
    ("Rover11035", 7),
    ("Rover4396", 7),
    ("Rover1039", 8),
    ("Rover4144", 8),
    ("Rover4516", 8),
    ("Rover1040", 8),
    ("Rover9770", 8),
    ("synthetic_2cubes_ratio1e0", 8),
    ("synthetic_2cubes_ratio1e6", 20),
    ("synthetic_2cubes_drag_ratio1e6", 35),
    ("Confeti-ex03-Fc3D-SBM", 80),
];

fn answer(recorded: &Recorded, options: &SolverOptions) -> (Vec<f64>, SolveReport) {
    let problem =
        FrictionContactProblem::new(recorded.dimension, &recorded.W, &recorded.q, &recorded.mu)
            .expect("a sound problem");
    let n = problem.n_unknowns();
    let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
    let report = solve(
        &problem,
        options,
        &mut p,
        &mut u,
        &mut SolverWorkspace::new(),
    );
    (u, report)
}

#[test]
fn recorded_problems_of_up_to_sixty_contacts() {
    for problem in recorded(|name| !name.starts_with("LMGC")) {
        if problem.mu.len() > 60 {
            continue;
        }
        let (_, report) = answer(&problem, &SolverOptions::default());
        assert!(report.is_converged(), "{}: {report:?}", problem.name);
        assert!(report.velocity_error < 1e-9, "{}: {report:?}", problem.name);
        let bound = ITERATIONS
            .iter()
            .find(|(name, _)| *name == problem.name)
            .map_or(60, |(_, bound)| *bound);
        assert!(
            report.iterations <= bound,
            "{}: slower than the snapshot, {report:?}",
            problem.name
        );
    }
}

#[test]
fn rover_impacts_to_the_last_digits() {
    for problem in recorded(|name| name.starts_with("Rover")) {
        let (_, report) = answer(&problem, &SolverOptions::default());
        assert!(
            report.is_converged() && report.residual < 1e-12,
            "{}: {report:?}",
            problem.name
        );
    }
}

/// Two cubes, mass ratio up to 1e6, dragged by half the friction that each surface can bear: both move together, at
/// 2.4525e-4 m/s after the first step of 1 ms.
#[test]
fn dragged_cubes_move_together_at_any_mass_ratio() {
    for problem in recorded(|name| name.contains("drag")) {
        let (u, report) = answer(&problem, &SolverOptions::default());
        assert!(report.is_converged(), "{report:?}");
        // The lower four contacts slide on the ground, the upper four carry.
        for (i, u) in u.chunks_exact(3).enumerate() {
            let speed = u[1].hypot(u[2]);
            let expected = if i < 4 { DRAGGED } else { 0.0 };
            assert!(
                // the solver's own tolerance in m/s
                (speed - expected).abs() < 1e-9,
                "{}, contact {i}: {speed:e} m/s",
                problem.name
            );
        }
    }
}

/// Speed of the dragged pair after a step of 1 ms, m/s.
const DRAGGED: f64 = 2.4525e-4;

/// Up to 667 contacts, by islands and sparse factors; the one dense problem that takes long in a debug build is left to the next test.
#[test]
fn recorded_problems_of_any_size() {
    for problem in recorded(|name| !name.starts_with("LMGC")) {
        let (_, report) = answer(
            &problem,
            &SolverOptions {
                tolerance: 1e-8,
                ..SolverOptions::default()
            },
        );
        assert!(report.is_converged(), "{}: {report:?}", problem.name);
    }
}

#[test]
fn the_recorded_periodic_box() {
    for problem in recorded(|name| name.starts_with("LMGC")) {
        let (_, report) = answer(&problem, &SolverOptions::default());
        assert!(report.is_converged(), "{}: {report:?}", problem.name);
    }
}
