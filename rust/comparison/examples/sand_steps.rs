//! What a step in sand costs: `sand_steps [STEPS] [rest|drive|explore|jump] [batch]` prints
//! microseconds a step of a rover alone and of each of 8 in a batch on one thread. With a scene it
//! steps that alone, one rover or the batch, for counting instructions:
//! `valgrind --tool=callgrind --toggle-collect='*counted*'`. The scenes `derivatives` and
//! `derivatives-on-firm-ground` take steps of a drive with their derivatives.
//!
//! The rover is `open-rover` on wheels 0.08 m wide with grousers, in dry sand, at 5 ms: parked,
//! driven by a constant torque, or by torques and steering that change every ten steps: moderate
//! ones, or ones that spin the wheels (`jump`).

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/sand/sand_scenes.rs"]
#[allow(missing_docs, dead_code)]
mod sand_scenes;

use std::sync::Arc;
use std::time::Instant;

use rover_core::geometry::Plane;
use rover_core::integrator::StepReport;
use rover_core::multibody::Model;
use rover_core::simulation::{Batch, Differentiator, RoverSimulation};
use sand_scenes::{dry_sand, placed, wide};

/// Steps between two commands, and before the first.
const STEPS_A_COMMAND: usize = 10;
const STEPS_AT_REST: usize = 200;

/// Rovers of the batch.
const ROVERS: usize = 8;

/// Rounds of a measurement; the fastest counts.
const ROUNDS: usize = 3;

/// Largest torque, N m, of a policy that explores and of one that spins the wheels, and steering
/// angle, rad.
const TORQUE: f64 = 2.0;
const SPINNING: f64 = 8.0;
const STEERING: f64 = 0.5;

/// Between −1 and 1, spread evenly.
fn drawn(seed: usize) -> f64 {
    let x = (seed as f64 + 1.0) * 0.618_033_988_749_894_9 * 7.31;
    2.0 * (x * x - (x * x).floor()) - 1.0
}

/// Torques and steering, the latter of the wheels that can steer.
fn command(model: &Model, scene: &str, k: usize) -> ([f64; 6], [f64; 6]) {
    let at = |i: usize, size: f64| size * drawn(17 * k + i);
    let steering = |i: usize| {
        model.wheels()[i]
            .steering
            .map_or(0.0, |_| at(6 + i, STEERING))
    };
    match scene {
        "rest" => ([0.0; 6], [0.0; 6]),
        "drive" => ([1.0; 6], [0.0; 6]),
        _ => {
            let torque = if scene == "jump" { SPINNING } else { TORQUE };
            (
                std::array::from_fn(|i| at(i, torque)),
                std::array::from_fn(steering),
            )
        }
    }
}

fn start() -> RoverSimulation {
    let mut sim = placed(&wide("open-rover", 0.08, 1.0), dry_sand(), 0.0, 0.005);
    sim.step(STEPS_AT_REST).unwrap();
    sim
}

#[inline(never)]
fn counted(sim: &mut RoverSimulation, scene: &str, steps: usize) -> StepReport {
    let mut report = StepReport::default();
    for k in 0..steps / STEPS_A_COMMAND {
        let (torques, angles) = command(sim.model(), scene, k);
        sim.set_wheel_torques(&torques).unwrap();
        sim.set_steering(&angles).unwrap();
        report.merge(&sim.step(STEPS_A_COMMAND).unwrap());
    }
    report
}

fn batch() -> Batch {
    Batch::new(vec![start(); ROVERS], Vec::new(), Some(1)).unwrap()
}

#[inline(never)]
fn counted_batch(batch: &mut Batch, scene: &str, steps: usize) {
    let model = wide("open-rover", 0.08, 1.0);
    let mut rows = vec![0.0; ROVERS * batch.layout().size()];
    for k in 0..steps / STEPS_A_COMMAND {
        let (mut torques, mut angles) = (Vec::new(), Vec::new());
        for i in 0..ROVERS {
            let (own_torques, own_angles) = command(&model, scene, k + 100 * i);
            torques.extend(own_torques);
            angles.extend(own_angles);
        }
        batch
            .step(&torques, &angles, STEPS_A_COMMAND, None, &mut rows)
            .unwrap();
    }
}

#[inline(never)]
fn counted_derivatives(sim: &RoverSimulation, steps: usize) {
    let mut differentiator = Differentiator::new(sim).unwrap();
    let state = differentiator.state_of(sim);
    let commands = [[1.0; 6], [0.0; 6]].concat().repeat(steps);
    (differentiator.trajectory(&state, (steps, &commands), &[], &mut || true)).unwrap();
}

/// A parked rover that has begun to drive, in sand or on firm ground.
fn on_its_way(is_firm: bool) -> RoverSimulation {
    let mut sim = placed(&wide("open-rover", 0.08, 1.0), dry_sand(), 0.0, 0.005);
    if is_firm {
        let (model, ground) = (Arc::clone(sim.model()), Arc::new(Plane::ground()));
        let (q, v) = (sim.q().clone(), sim.v().to_vec());
        sim = RoverSimulation::new(model, ground, sim.options().clone()).unwrap();
        sim.set_state(q, v);
    }
    counted(&mut sim, "rest", STEPS_AT_REST);
    counted(&mut sim, "drive", STEPS_AT_REST);
    sim
}

/// Microseconds a step and rover of a batch.
fn in_batch(scene: &str, steps: usize) -> f64 {
    let mut batch = batch();
    let begin = Instant::now();
    counted_batch(&mut batch, scene, steps);
    1e6 * begin.elapsed().as_secs_f64() / (ROVERS * steps) as f64
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments.get(1).and_then(|n| n.parse().ok()).unwrap_or(500);
    if let Some(scene) = arguments.get(2) {
        if scene.starts_with("derivatives") {
            counted_derivatives(&on_its_way(scene != "derivatives"), steps);
        } else if arguments.len() > 3 {
            counted_batch(&mut batch(), scene, steps);
        } else {
            counted(&mut start(), scene, steps);
        }
        return;
    }
    println!(
        "{:<8} {:>10} {:>10}  us a step {:>10} {:>14}",
        "scene", "alone", "in batch", "repeated", "status"
    );
    for scene in ["rest", "drive", "explore", "jump"] {
        let (mut alone, mut batch) = (f64::INFINITY, f64::INFINITY);
        let mut report = StepReport::default();
        for _ in 0..ROUNDS {
            let mut sim = start();
            let begin = Instant::now();
            report = counted(&mut sim, scene, steps);
            alone = alone.min(1e6 * begin.elapsed().as_secs_f64() / steps as f64);
            batch = batch.min(in_batch(scene, steps));
        }
        let repeated = report.retaken as f64 / steps as f64;
        let state = format!("{:?}", report.status);
        println!(
            "{scene:<8} {alone:>10.1} {batch:>10.1} {:>10} {repeated:>10.2} {state:>14}",
            ""
        );
    }
}
