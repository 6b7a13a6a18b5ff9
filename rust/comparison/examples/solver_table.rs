//! Prints one row per friction-contact problem, of the shelf and recorded ones, and method:
//! iterations, residual, velocity error, time (best of many); then the times of each method over
//! all problems, and how many it leaves unsolved.
//!
//! `cargo run --release -p rover-comparison --example solver_table -- [name filter] [method]
//! [tolerance]`, where the method is `auto`, `nsgs`, `newton`, `proximal`, `admm`, `relaxed` or
//! `all`.
#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/solver/npz.rs"]
#[allow(missing_docs)]
mod npz;

use std::sync::OnceLock;
use std::time::Instant;

use friction_contact::problem::FrictionContactProblem;
use friction_contact::solver::{Method, SolverOptions, SolverWorkspace, solve};

/// Seconds since the program's first look at the clock.
fn now() -> f64 {
    static BEGIN: OnceLock<Instant> = OnceLock::new();
    BEGIN.get_or_init(Instant::now).elapsed().as_secs_f64()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let filter = arguments.first().map_or("", String::as_str);
    let asked = arguments.get(1).map_or("auto", String::as_str);
    let methods: Vec<Method> = match Method::from_name(asked) {
        Some(method) => vec![method],
        None => Method::ALL.to_vec(),
    };
    let tolerance = arguments
        .get(2)
        .and_then(|text| text.parse().ok())
        .unwrap_or(SolverOptions::default().tolerance);
    println!(
        "{:42} {:>4} {:>14} {:>14} {:>6} {:>9} {:>9} {:>12}",
        "problem", "nc", "method", "status", "iter", "residual", "m/s", "time"
    );
    let mut times = vec![(Vec::new(), 0); methods.len()];
    let shelf = npz::shelf(|name| name.contains(filter));
    let outside = npz::recorded(|name| name.contains(filter));
    for recorded in shelf.into_iter().chain(outside) {
        let problem =
            FrictionContactProblem::new(recorded.dimension, &recorded.W, &recorded.q, &recorded.mu)
                .expect("a sound problem");
        let n = problem.n_unknowns();
        for (&method, (times, unsolved)) in methods.iter().zip(&mut times) {
            let options = SolverOptions {
                method,
                tolerance,
                ..SolverOptions::default()
            };
            let mut workspace = SolverWorkspace::new();
            let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
            let mut report = solve(&problem, &options, &mut p, &mut u, &mut workspace);
            let (mut best, mut runs, mut spent) = (f64::INFINITY, 0, 0.0);
            while runs == 0 || (spent < 0.02 && runs < 10_000) {
                p.fill(0.0);
                let begin = now();
                report = solve(&problem, &options, &mut p, &mut u, &mut workspace);
                let time = now() - begin;
                best = best.min(time);
                spent += time;
                runs += 1;
            }
            times.push(1e6 * best);
            *unsolved += usize::from(!report.is_converged());
            println!(
                "{:42} {:4} {:>14} {:>14} {:6} {:9.1e} {:9.1e} {:>10.1} us",
                recorded.name,
                problem.n_contacts(),
                report.method.name(),
                format!("{:?}", report.status),
                report.iterations,
                report.residual,
                report.velocity_error,
                1e6 * best,
            );
        }
    }
    for (method, (mut times, unsolved)) in methods.iter().zip(times) {
        times.sort_by(f64::total_cmp);
        let Some(last) = times.len().checked_sub(1) else {
            continue;
        };
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        let [median, most_of, most] = [last / 2, last * 99 / 100, last].map(|k| times[k]);
        println!(
            "{:>14}: {} problems, mean {mean:.1}, median {median:.1}, 99% {most_of:.1}, largest {most:.1} us, \
             {unsolved} unsolved",
            method.name(),
            times.len()
        );
    }
}
