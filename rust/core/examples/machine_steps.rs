//! What a step of other machines costs: `machine_steps [STEPS]` prints microseconds of the general
//! step, of the fast step alone, and of each of 8 in a batch on one thread. With the name of a
//! machine and `general`, `alone` or `batch` it takes only such steps, for counting instructions:
//! `valgrind --tool=callgrind --toggle-collect='*counted*'`.
//!
//! Steps of 5 ms on a plane, with torques that change every ten steps.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/rover_kinds.rs"]
#[allow(missing_docs, dead_code)]
mod rover_kinds;

use std::sync::Arc;
use std::time::Instant;

use rover_core::draw::resting_pose;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::multibody::{Model, ModelDescription, coordinates};
use rover_core::simulation::{Batch, RoverSimulation};
use rover_kinds::{dry, mecanum, tracked, with_a_bar};

const STEPS_A_COMMAND: usize = 10;
const STEPS_AT_REST: usize = 200;

/// Rovers of the batch.
const ROVERS: usize = 8;

/// Rounds of a measurement; the fastest counts.
const ROUNDS: usize = 3;

/// Largest torque, as a share of that which a wheel's part of the weight resists at the rim.
const EFFORT: f64 = 0.2;

const NAMES: [&str; 7] = [
    "rover",
    "mecanum",
    "dry",
    "open-rover",
    "open-dry",
    "bar",
    "tracks",
];

fn description(name: &str) -> ModelDescription {
    let open = || ModelDescription::named("open-rover").unwrap();
    match name {
        "rover" => ModelDescription::rover(),
        "mecanum" => mecanum(),
        "dry" => dry(ModelDescription::rover(), 2.0, 30.0),
        "open-rover" => open(),
        "open-dry" => dry(open(), 0.02, 0.3),
        "bar" => with_a_bar(),
        "tracks" => tracked(9),
        _ => panic!("a machine: one of {NAMES:?}"),
    }
}

/// Between −1 and 1, spread evenly.
fn drawn(seed: usize) -> f64 {
    let x = (seed as f64 + 1.0) * 0.618_033_988_749_894_9 * 7.31;
    2.0 * (x * x - (x * x).floor()) - 1.0
}

/// Torques of the wheels.
fn torques(model: &Model, k: usize) -> Vec<f64> {
    let n = model.wheels().len();
    let most = |i: usize| {
        let wheel = &model.wheels()[i];
        let share = EFFORT * 0.7 * 9.81 * model.mass() * wheel.radius / n as f64;
        share.min(wheel.torque_limit)
    };
    (0..n).map(|i| most(i) * drawn(17 * k + i)).collect()
}

fn start(name: &str) -> RoverSimulation {
    let model = Arc::new(Model::from_description(description(name)).unwrap());
    let ground = Plane::ground();
    let q = resting_pose(&model, &ground, [0.0, 0.0], 0.0).unwrap();
    let q = coordinates::from_public(&model, &q).unwrap();
    let options = StepOptions::default();
    let mut sim = RoverSimulation::new(Arc::clone(&model), Arc::new(ground), options).unwrap();
    sim.set_state(q, vec![0.0; model.nv()]);
    sim.step(STEPS_AT_REST).unwrap();
    sim
}

#[inline(never)]
fn counted(sim: &mut RoverSimulation, steps: usize, is_general: bool) -> usize {
    let mut fallbacks = 0;
    for k in 0..steps / STEPS_A_COMMAND {
        let torques = torques(sim.model(), k);
        sim.set_wheel_torques(&torques).unwrap();
        if is_general {
            sim.step_with(&MoreauJean, STEPS_A_COMMAND).unwrap();
        } else {
            fallbacks += sim.step(STEPS_A_COMMAND).unwrap().fallbacks;
        }
    }
    fallbacks
}

fn batch(name: &str) -> (Batch, Arc<Model>) {
    let start = start(name);
    let model = Arc::clone(start.model());
    let batch = Batch::new(vec![start; ROVERS], Vec::new(), Some(1)).unwrap();
    (batch, model)
}

#[inline(never)]
fn counted_batch((batch, model): &mut (Batch, Arc<Model>), steps: usize) {
    let mut rows = vec![0.0; ROVERS * batch.layout().size()];
    let steering = vec![0.0; ROVERS * model.wheels().len()];
    for k in 0..steps / STEPS_A_COMMAND {
        let torques: Vec<f64> = (0..ROVERS)
            .flat_map(|i| torques(model, k + 100 * i))
            .collect();
        batch
            .step(&torques, &steering, STEPS_A_COMMAND, None, &mut rows)
            .unwrap();
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments.get(1).and_then(|n| n.parse().ok()).unwrap_or(500);
    if let [_, _, name, how] = &arguments[..] {
        match how.as_str() {
            "batch" => counted_batch(&mut batch(name), steps),
            _ => {
                counted(&mut start(name), steps, how == "general");
            }
        }
        return;
    }
    println!(
        "{:<12} {:>8} {:>8} {:>8}  us a step {:>9}",
        "machine", "general", "alone", "in batch", "fallbacks"
    );
    for name in NAMES {
        let mut fastest = [f64::INFINITY; 3];
        let mut fallbacks = 0;
        for _ in 0..ROUNDS {
            for (k, fastest) in fastest.iter_mut().enumerate() {
                let (mut sim, mut batch) = (start(name), batch(name));
                let begin = Instant::now();
                let n = if k == 2 {
                    counted_batch(&mut batch, steps);
                    ROVERS
                } else {
                    fallbacks = counted(&mut sim, steps, k == 0);
                    1
                };
                let micros = 1e6 * begin.elapsed().as_secs_f64();
                *fastest = fastest.min(micros / (n * steps) as f64);
            }
        }
        let [general, alone, together] = fastest;
        println!("{name:<12} {general:>8.1} {alone:>8.1} {together:>8.1} {fallbacks:>20}");
    }
}
