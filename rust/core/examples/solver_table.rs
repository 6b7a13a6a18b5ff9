//! Prints one row per recorded friction-contact problem and method: iterations, residual, velocity error, time.
//!
//! `cargo run --release --example solver_table -- [name filter] [auto|nsgs|newton|proximal]`
#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/physics/solver_npz.rs"]
#[allow(missing_docs)]
mod solver_npz;

use std::time::Instant;

use rover_core::problem::FrictionContactProblem;
use rover_core::solver::{Method, SolverOptions, SolverWorkspace, solve};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let filter = arguments.first().map_or("", String::as_str);
    let methods: Vec<Method> = match arguments.get(1).map(String::as_str) {
        None | Some("auto") => vec![Method::Auto],
        Some("nsgs") => vec![Method::GaussSeidel],
        Some("newton") => vec![Method::Newton],
        Some("proximal") => vec![Method::ProximalPoint],
        Some(_) => vec![
            Method::Auto,
            Method::GaussSeidel,
            Method::Newton,
            Method::ProximalPoint,
        ],
    };
    println!(
        "{:42} {:>4} {:>14} {:>14} {:>6} {:>9} {:>9} {:>12}",
        "problem", "nc", "method", "status", "iter", "residual", "m/s", "time"
    );
    for recorded in solver_npz::recorded(|name| name.contains(filter)) {
        let problem =
            FrictionContactProblem::new(recorded.dimension, &recorded.W, &recorded.q, &recorded.mu)
                .expect("a sound problem");
        let n = problem.n_unknowns();
        for &method in &methods {
            let options = SolverOptions {
                method,
                ..SolverOptions::default()
            };
            let mut workspace = SolverWorkspace::new();
            let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
            let mut report = solve(&problem, &options, &mut p, &mut u, &mut workspace);
            let begin = Instant::now();
            let mut runs = 0_u32;
            while runs == 0 || (begin.elapsed().as_secs_f64() < 0.02 && runs < 10_000) {
                p.fill(0.0);
                report = solve(&problem, &options, &mut p, &mut u, &mut workspace);
                runs += 1;
            }
            println!(
                "{:42} {:4} {:>14} {:>14} {:6} {:9.1e} {:9.1e} {:>12.2?}",
                recorded.name,
                problem.n_contacts(),
                format!("{:?}", report.method),
                format!("{:?}", report.status),
                report.iterations,
                report.residual,
                report.velocity_error,
                begin.elapsed() / runs,
            );
        }
    }
}
