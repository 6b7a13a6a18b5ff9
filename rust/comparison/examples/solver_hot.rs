//! The time stepper's hot path: six contacts, warm-started step after step.
//!
//! `cargo run --release -p rover-comparison --example solver_hot -- [scene] [steps]`, where the
//! scene is `parked`, `driving`, `turning`, `bumping` or `frictionless`.
//! For instruction counts:
//!
//! ```sh
//! valgrind --tool=callgrind --toggle-collect='*solver_hot*counted*' \
//!     target/release/examples/solver_hot turning 1000
//! ```
#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/solver/scenes.rs"]
#[allow(missing_docs)]
mod scenes;

use std::time::{Duration, Instant};

use friction_contact::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};
use scenes::{Problem, ROVER_NV, rover};

#[inline(never)]
fn counted(
    problem: &Problem,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    let problem = friction_contact::problem::FrictionContactProblem::from_assembled(
        problem.dimension,
        &problem.W,
        &problem.q,
        &problem.mu,
    );
    solve(&problem, &SolverOptions::default(), p, u, workspace)
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "all".into());
    let steps: usize = arguments
        .next()
        .and_then(|s| s.parse().ok())
        .unwrap_or(20_000);
    for scenario in ["parked", "driving", "turning", "bumping", "frictionless"] {
        if name == scenario || name == "all" {
            run(scenario, steps);
        }
    }
}

fn run(scenario: &str, steps: usize) {
    let h = 2e-3;
    let steering = if scenario == "turning" {
        [0.3, 0.3, 0.0, -0.2, 0.0, -0.2]
    } else {
        [0.0; 6]
    };
    let mu = if scenario == "frictionless" { 0.0 } else { 0.7 };
    let scene = rover(steering, mu);
    let mut v = vec![0.0; ROVER_NV];
    let (mut p, mut u) = (vec![0.0; 18], vec![0.0; 18]);
    let mut workspace = SolverWorkspace::new();
    let mut problem = scene.problem(&v);
    let mut times: Vec<Duration> = Vec::with_capacity(steps);
    let (mut iterations, mut converged, mut residual) = (0, 0, 0.0_f64);
    for step in 0..steps {
        let t = h * step as f64;
        v[1] -= 9.81 * h;
        if scenario != "parked" {
            for wheel in 0..6 {
                v[9 + wheel] += h * (8.0 + 6.0 * (0.7 * t + wheel as f64).sin()) / 0.15;
                // Rolling resistance keeps the speed finite.
                v[9 + wheel] *= 1.0 - 0.02 * h / 0.15;
            }
            v[0] *= 1.0 - 0.5 * h;
        }
        if scenario == "bumping" {
            // A swaying load lifts wheels in turn.
            v[3] += h * 40.0 * (3.0 * t).sin();
            v[5] += h * 60.0 * (2.0 * t).cos();
            v[7] += h * 60.0 * (5.0 * t).sin();
        }
        problem.q = scene.local_velocity(&v);
        let begin = Instant::now();
        let report = counted(&problem, &mut p, &mut u, &mut workspace);
        times.push(begin.elapsed());
        iterations += report.iterations;
        converged += usize::from(report.is_converged());
        residual = residual.max(report.residual);
        scene.push(&mut v, &p);
    }
    times.sort_unstable();
    println!(
        "{scenario:13} median {:6.3} us, 99% {:6.3} us, {:5.2} iterations, {converged}/{steps} converged, residual {residual:.1e}",
        1e6 * times[steps / 2].as_secs_f64(),
        1e6 * times[steps * 99 / 100].as_secs_f64(),
        iterations as f64 / steps as f64,
    );
}
