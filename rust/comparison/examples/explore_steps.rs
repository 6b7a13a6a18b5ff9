//! Steps of a rover whose policy explores, for counting instructions under
//! `valgrind --tool=callgrind`. The drives are those of `benchmarks/comparison/exploring.json`;
//! SCENE is a name of `tests/physics/exploring_scenes.rs`.
//!
//! `explore_steps STEPS SCENE alone|batch` takes so many steps with torques of up to 60 N m, with
//! one rover or a batch of eight on one thread. `make instructions` counts them.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use exploring_scenes::{Drive, STEPS_A_COMMAND, Scene, drives};
use rover_core::integrator::{StepError, StepOptions};
use rover_core::simulation::Batch;

/// Largest torque, N m.
const TORQUE: f64 = 60.0;

/// Rovers of a batch, and how far apart in a record copies of a drive begin.
const ROVERS: usize = 8;
const SHIFT: usize = 13;

fn alone(mut drive: Drive, steps: usize) -> Result<(), StepError> {
    for command in 0..steps / STEPS_A_COMMAND {
        drive.give(command % drive.n_commands());
        drive.simulation.step(STEPS_A_COMMAND)?;
    }
    Ok(())
}

fn in_batch(drives: &[Drive], steps: usize) {
    let own = |i: usize| &drives[i % drives.len()];
    let rovers = (0..ROVERS).map(|i| own(i).simulation.clone());
    let mut batch = Batch::new(rovers.collect(), Vec::new(), Some(1)).unwrap();
    let mut rows = vec![0.0; ROVERS * batch.layout().size()];
    for k in 0..steps / STEPS_A_COMMAND {
        let commands = (0..ROVERS).map(|i| own(i).command((k + SHIFT * i) % own(i).n_commands()));
        let (torques, steering): (Vec<_>, Vec<_>) = commands.unzip();
        let (torques, steering) = (torques.concat(), steering.concat());
        (batch.step(&torques, &steering, STEPS_A_COMMAND, None, &mut rows)).unwrap();
    }
}

fn main() -> Result<(), StepError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| arguments.get(k).map_or("", String::as_str);
    let (Ok(steps), Some(scene)) = (word(0).parse(), Scene::of(word(1))) else {
        println!("usage: explore_steps STEPS SCENE alone|batch");
        std::process::exit(2);
    };
    let mut drives = drives(scene, TORQUE, &StepOptions::default());
    if word(2) == "batch" {
        in_batch(&drives, steps);
        return Ok(());
    }
    alone(drives.swap_remove(0), steps)
}
