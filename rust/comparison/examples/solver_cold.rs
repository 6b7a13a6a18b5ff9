//! Recorded impacts of a rover, solved from zero:
//! `cargo run --release -p rover-comparison --example solver_cold -- [name filter] [runs]`.
//!
//! Prints the time of the median and of the fastest run. For instruction counts:
//!
//! ```sh
//! valgrind --tool=callgrind --toggle-collect='*solver_cold*counted*' \
//!     target/release/examples/solver_cold Rover1040 1000
//! ```
#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/solver/npz.rs"]
#[allow(missing_docs)]
mod npz;

use std::time::Instant;

use friction_contact::problem::FrictionContactProblem;
use friction_contact::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

#[inline(never)]
fn counted(
    problem: &FrictionContactProblem<'_>,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    solve(problem, &SolverOptions::default(), p, u, workspace)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let filter = arguments.first().map_or("Rover", String::as_str);
    let runs: usize = arguments
        .get(1)
        .and_then(|text| text.parse().ok())
        .unwrap_or(50_000);
    println!(
        "{:12} {:>8} {:>6} {:>9} {:>12} {:>12}",
        "problem", "contacts", "iter", "residual", "median", "fastest"
    );
    for recorded in npz::recorded(|name| name.starts_with(filter)) {
        let problem =
            FrictionContactProblem::new(recorded.dimension, &recorded.W, &recorded.q, &recorded.mu)
                .expect("a sound problem");
        let n = problem.n_unknowns();
        let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
        let mut workspace = SolverWorkspace::new();
        let mut times = Vec::with_capacity(runs);
        let mut last = None;
        for _ in 0..runs {
            p.fill(0.0);
            let begin = Instant::now();
            last = Some(counted(&problem, &mut p, &mut u, &mut workspace));
            times.push(begin.elapsed().as_secs_f64());
        }
        times.sort_unstable_by(f64::total_cmp);
        let (Some(report), Some(&fastest)) = (last, times.first()) else {
            continue;
        };
        println!(
            "{:12} {:8} {:6} {:9.1e} {:>9.2} us {:>9.2} us",
            recorded.name,
            problem.n_contacts(),
            report.iterations,
            report.residual,
            1e6 * times[runs / 2],
            1e6 * fastest,
        );
    }
}
