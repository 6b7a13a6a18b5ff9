//! Rover-steps a second of CPU for the models of the gallery, alone and in a batch of 64:
//! `gallery_rates [MODEL...]`.
//!
//! A plane, steps of 5 ms; torques and steering of every rover are drawn anew every ten steps. Best
//! of several runs on one thread.

#![allow(clippy::print_stdout)] // its purpose

use std::sync::Arc;
use std::time::Instant;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepError, StepOptions};
use rover_core::multibody::{Configuration, Model, ModelDescription};
use rover_core::scalar::Instructions;
use rover_core::simulation::RoverSimulation;
use rover_core::simulation::lane_batch::{BatchRover, LaneBatch};

/// Rovers of the batch.
const BATCH: usize = 64;

/// Steps between two commands, commands in a run, and runs.
const STEPS: usize = 10;
const COMMANDS: usize = 40;
const RUNS: usize = 5;

/// A rover a little above the ground.
fn rover(model: &Arc<Model>) -> RoverSimulation {
    let ground = Arc::new(Plane::ground());
    let rover = RoverSimulation::new(Arc::clone(model), ground, StepOptions::default());
    let mut rover = rover.expect("valid options");
    let mut start = Configuration::zero(model);
    let wheels = model.wheels().iter();
    let kinematics = rover_core::multibody::Kinematics::of(model, &start);
    let lowest = wheels.map(|wheel| kinematics.point(wheel.body, &wheel.centre).y - wheel.radius);
    start.position.y = 0.01 - lowest.fold(f64::INFINITY, f64::min);
    rover.set_state(start, vec![0.0; model.nv()]);
    rover
}

/// A number from −1 to 1.
fn number(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn command(rover: &mut RoverSimulation, state: &mut u64) {
    let wheels = rover.model().wheels().to_vec();
    let torques: Vec<f64> = (wheels.iter())
        .map(|w| 0.5 * w.torque_limit * number(state))
        .collect();
    let steering: Vec<f64> = (wheels.iter())
        .map(|w| w.steering_limit * number(state))
        .collect();
    rover
        .set_commands(&torques, &steering)
        .expect("valid commands");
}

/// Rover-steps a second of one call after another.
fn rate(rovers: &mut [RoverSimulation], batch: &mut LaneBatch) -> f64 {
    let mut state = 7;
    let mut errors: Vec<Option<StepError>> = vec![None; rovers.len()];
    let mut run = || {
        let begin = Instant::now();
        for _ in 0..COMMANDS {
            for rover in rovers.iter_mut() {
                command(rover, &mut state);
            }
            let mut entries: Vec<BatchRover<'_>> = (rovers.iter_mut().zip(&mut errors))
                .map(|(rover, error)| BatchRover { rover, error })
                .collect();
            batch.advance(&mut entries, STEPS, &mut || true);
        }
        (COMMANDS * STEPS * rovers.len()) as f64 / begin.elapsed().as_secs_f64()
    };
    (0..RUNS).map(|_| run()).fold(0.0, f64::max)
}

fn main() {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    if names.is_empty() {
        names = ModelDescription::names().map(str::to_owned).to_vec();
    }
    println!("model          nv     alone  in a batch, rover-steps a second");
    for name in names {
        let description = ModelDescription::named(&name).expect("a model of the gallery");
        let model = Arc::new(Model::from_description(description).expect("valid"));
        let mut batch = LaneBatch::new(Instructions::of_this_machine());
        let alone = rate(&mut [rover(&model)], &mut batch);
        let mut rovers: Vec<RoverSimulation> = (0..BATCH).map(|_| rover(&model)).collect();
        let batch = rate(&mut rovers, &mut batch);
        println!("{name:13} {:3} {alone:9.0} {batch:11.0}", model.nv());
    }
}
