//! Residual against iterations and time, for 1, 10 and 100 contacts and every method:
//! `cargo bench -p friction-contact --bench solver`.
//!
//! It only reports. Name the machine when quoting. `rust/comparison/examples/solver_hot.rs`
//! measures the hot path of a rover step, `solver_table.rs` the recorded problems.
#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/solver/scenes.rs"]
#[allow(missing_docs)]
mod scenes;

use std::time::Instant;

use friction_contact::solver::{Method, SolverOptions, SolverWorkspace, solve};
use scenes::{Problem, falling, pile, table};

/// Runs per row; the fastest counts.
const RUNS: usize = 20;

fn main() {
    let tilted = [0.002, -0.02, 0.001, 0.0, 0.003, 0.0];
    let scenes: [(&str, Problem); 5] = [
        ("table on 1 leg", table(1, 0.5).problem(&tilted)),
        ("table on 10 legs", table(10, 0.5).problem(&tilted)),
        ("table on 100 legs", table(100, 0.5).problem(&tilted)),
        (
            "pile of 2, ratio 1e4",
            pile(&[1.0, 1e4], 0.9).problem(&falling(2, 0.01)),
        ),
        (
            "pile of 25",
            pile(&[1.0; 25], 0.9).problem(&falling(25, 0.01)),
        ),
    ];
    println!(
        "{:22} {:>14} {:>6} {:>9} {:>9} {:>12}",
        "scene", "method", "iter", "residual", "m/s", "time"
    );
    for (name, problem) in &scenes {
        for method in [
            Method::GaussSeidel,
            Method::Newton,
            Method::ProximalPoint,
            Method::Auto,
        ] {
            for limit in [1, 3, 10, 30, 100, 300] {
                let options = SolverOptions {
                    method,
                    max_sweeps: limit,
                    max_newton_steps: limit,
                    ..SolverOptions::default()
                };
                let n = problem.q.len();
                let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
                let mut workspace = SolverWorkspace::new();
                let mut best = f64::INFINITY;
                let mut last = None;
                for _ in 0..RUNS {
                    p.fill(0.0);
                    let view = problem.view();
                    let begin = Instant::now();
                    last = Some(solve(&view, &options, &mut p, &mut u, &mut workspace));
                    best = best.min(begin.elapsed().as_secs_f64());
                }
                let Some(report) = last else { continue };
                println!(
                    "{name:22} {:>14} {:6} {:9.1e} {:9.1e} {:9.2} us",
                    format!("{method:?}"),
                    report.iterations,
                    report.residual,
                    report.velocity_error,
                    1e6 * best,
                );
                if report.is_converged() {
                    break;
                }
            }
        }
    }
}
