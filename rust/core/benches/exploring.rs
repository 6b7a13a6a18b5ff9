//! Microseconds a step of a rover whose policy explores, on one thread, and what the contact solver
//! does meanwhile: `cargo bench -p rover-core --bench exploring`.
//!
//! It only reports. The drives are those of `benchmarks/comparison/exploring.json`: random torques
//! and set-points, redrawn every ten steps of 5 ms. A time is the median of eleven rounds; each
//! plays all drives at both tolerances. A batch has 64 rovers, all drives eight times over with
//! commands in another order; its time is a rover's. Steps that the general code took count as
//! general.
//! `-- --json SCENE TORQUE` measures one scene and prints JSON, for
//! `make bench`, which sets other figures beside these.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use std::collections::BTreeMap;
use std::time::Instant;

use exploring_scenes::{Drive, STEPS_A_COMMAND, Scene, TORQUES, drives};
use rover_core::integrator::{StepError, StepOptions};
use rover_core::simulation::Batch;
use rover_core::solver::SolverOptions;
use serde_json::{Value, json};

/// The tolerances: the default, and that of a hasty user.
const TOLERANCES: [f64; 2] = [1e-12, 1e-6];

const ROUNDS: usize = 11;

/// Rovers of a batch, and how far apart in a record copies of a drive begin.
const ROVERS: usize = 64;
const SHIFT: usize = 13;

/// Number of steps by the size of something.
type Histogram = BTreeMap<usize, usize>;

/// The figures of a scene.
struct Measured {
    /// Microseconds a step at each tolerance.
    microseconds: [f64; 2],
    /// Microseconds a step of a rover in a batch, at the first tolerance.
    batch_microseconds: f64,
    steps: usize,
    /// Steps that the general code took.
    general: usize,
    not_converged: usize,
    iterations: Histogram,
    factorisations: Histogram,
    pivots: Histogram,
}

fn options(tolerance: f64) -> StepOptions {
    StepOptions {
        solver: SolverOptions {
            tolerance,
            ..SolverOptions::default()
        },
        ..StepOptions::default()
    }
}

/// Microseconds a step over all drives.
fn time(drives: &[Drive]) -> Result<f64, StepError> {
    let (mut seconds, mut steps) = (0.0, 0);
    for drive in drives {
        let mut drive = drive.clone();
        let start = Instant::now();
        steps += drive.play()?.steps;
        seconds += start.elapsed().as_secs_f64();
    }
    Ok(1e6 * seconds / steps as f64)
}

/// Microseconds a step of a rover in a batch on one thread.
fn time_of_batch(drives: &[Drive]) -> f64 {
    let rovers = (0..ROVERS).map(|i| drives[i % drives.len()].simulation.clone());
    let mut batch = Batch::new(rovers.collect(), Vec::new(), Some(1)).unwrap();
    let mut rows = vec![0.0; ROVERS * batch.layout().size()];
    let n_commands = drives[0].n_commands();
    let mut seconds = 0.0;
    for command in 0..n_commands {
        let (mut torques, mut steering) = (Vec::new(), Vec::new());
        for i in 0..ROVERS {
            let place = (command + SHIFT * (i / drives.len())) % n_commands;
            let (own_torques, own_steering) = drives[i % drives.len()].command(place);
            torques.extend(own_torques);
            steering.extend(own_steering);
        }
        let start = Instant::now();
        batch
            .step(&torques, &steering, STEPS_A_COMMAND, None, &mut rows)
            .unwrap();
        seconds += start.elapsed().as_secs_f64();
    }
    1e6 * seconds / (ROVERS * n_commands * STEPS_A_COMMAND) as f64
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn measure(scene: Scene, torque: f64) -> Result<Measured, StepError> {
    let drives = TOLERANCES.map(|tolerance| drives(scene, torque, &options(tolerance)));
    let mut times = [Vec::new(), Vec::new()];
    let mut in_batch = Vec::new();
    for round in 0..ROUNDS {
        if round % 4 == 0 {
            in_batch.push(time_of_batch(&drives[0]));
        }
        for (times, drives) in times.iter_mut().zip(&drives) {
            times.push(time(drives)?);
        }
    }
    let mut measured = Measured {
        microseconds: times.map(median),
        batch_microseconds: median(in_batch),
        steps: 0,
        general: 0,
        not_converged: 0,
        iterations: Histogram::new(),
        factorisations: Histogram::new(),
        pivots: Histogram::new(),
    };
    for drive in &drives[0] {
        drive.clone().play_by_step(|report| {
            measured.steps += 1;
            measured.general += report.fallbacks;
            measured.not_converged += usize::from(!report.is_converged());
            *measured.iterations.entry(report.iterations).or_default() += 1;
            let factorisations = &mut measured.factorisations;
            *factorisations.entry(report.factorisations).or_default() += 1;
            *measured.pivots.entry(report.pivots).or_default() += 1;
        })?;
    }
    Ok(measured)
}

/// Mean, median, 99th percentile and largest, of a table's column.
fn summary(histogram: &Histogram) -> String {
    let n: usize = histogram.values().sum();
    let total: usize = histogram.iter().map(|(size, count)| size * count).sum();
    let quantile = |share: f64| {
        let mut seen = 0;
        let rank = (share * n as f64).ceil();
        let reached = histogram.iter().find(|(_, count)| {
            seen += **count;
            seen as f64 >= rank
        });
        reached.map_or(0, |(size, _)| *size)
    };
    let mean = total as f64 / n as f64;
    let (median, most, largest) = (quantile(0.5), quantile(0.99), quantile(1.0));
    format!("{mean:6.2} {median:3} {most:3} {largest:4}")
}

fn as_json(measured: &Measured) -> Value {
    let pairs = |histogram: &Histogram| histogram.iter().map(|(a, b)| json!([a, b])).collect();
    let [iterations, factorisations, pivots]: [Value; 3] = [
        &measured.iterations,
        &measured.factorisations,
        &measured.pivots,
    ]
    .map(pairs);
    json!({
        "tolerances": TOLERANCES,
        "microseconds": measured.microseconds,
        "batch_microseconds": measured.batch_microseconds,
        "steps": measured.steps,
        "general": measured.general,
        "not_converged": measured.not_converged,
        "iterations": iterations,
        "factorisations": factorisations,
        "pivots": pivots,
    })
}

fn main() -> Result<(), StepError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(at) = arguments.iter().position(|a| a == "--json") {
        let scene = arguments.get(at + 1).and_then(|name| Scene::of(name));
        let torque = arguments.get(at + 2).and_then(|t| t.parse().ok());
        let (scene, torque) = (
            scene.expect("the name of a scene"),
            torque.expect("a torque"),
        );
        println!("{}", as_json(&measure(scene, torque)?));
        return Ok(());
    }
    println!(
        "{:<22} {:>6} {:>9} {:>9} {:>9} {:>7} {:>6} {:^20} {:^20} {:^20}",
        "exploring, 5 ms",
        "N m",
        "us, 1e-12",
        "us, 1e-6",
        "us, batch",
        "general",
        "failed",
        "iterations",
        "factors",
        "pivots"
    );
    println!("{:<74} {}", "", "  mean med 99% most  ".repeat(3));
    for scene in Scene::ALL {
        for torque in TORQUES {
            let measured = measure(scene, torque)?;
            let [fine, coarse] = measured.microseconds;
            println!(
                "{:<22} {torque:>6} {fine:>9.2} {coarse:>9.2} {:>9.2} {:>7} {:>6}  {}   {}   {}",
                scene.name(),
                measured.batch_microseconds,
                measured.general,
                measured.not_converged,
                summary(&measured.iterations),
                summary(&measured.factorisations),
                summary(&measured.pivots),
            );
        }
    }
    Ok(())
}
