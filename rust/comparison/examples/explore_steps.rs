//! Steps of a rover whose policy explores, for counting instructions under
//! `valgrind --tool=callgrind`. The drives are those of `benchmarks/comparison/exploring.json`;
//! SCENE is a name of `tests/physics/exploring_scenes.rs`.
//!
//! - `explore_steps STEPS SCENE alone|batch` takes so many steps with torques of up to 60 N m, with
//!   one rover or a batch of eight on one thread. `make instructions` counts them.
//! - `explore_steps SCENE TORQUE DRIVES` plays the first DRIVES drives with torques of up to TORQUE
//!   N m, for the parts of a step: with `--collect-atstart=no --toggle-collect='*counted_step*'
//!   --dump-before='*part_ends*'` it counts every seventh step. Each part of a counted step ends
//!   with a call of `part_ends`, at which callgrind writes what the part took. The number of
//!   counted steps is printed, and the names of the parts in the same order, one a line. `make
//!   bench` adds them up.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use exploring_scenes::{Drive, STEPS_A_COMMAND, Scene, drives};
use rover_core::integrator::{Phase, Probe, StepError, StepOptions};
use rover_core::simulation::{Batch, RoverSimulation};

/// Every how many-th step is counted: prime to the steps of a command, so that each of them comes
/// up.
const EVERY: usize = 7;

/// Largest torque of the steps that are counted as a whole, N m.
const TORQUE: f64 = 60.0;

/// Rovers of a batch, and how far apart in a record copies of a drive begin.
const ROVERS: usize = 8;
const SHIFT: usize = 13;

/// The parts of the counted steps, in their order.
struct Parts(Vec<Phase>);

impl Probe for Parts {
    fn end(&mut self, phase: Phase) {
        self.0.push(phase);
        part_ends(phase);
    }
}

/// Where callgrind writes its counts.
#[inline(never)]
fn part_ends(phase: Phase) {
    std::hint::black_box(phase);
}

/// The only code that is counted by parts.
#[inline(never)]
fn counted_step(simulation: &mut RoverSimulation, parts: &mut Parts) -> Result<(), StepError> {
    simulation.step_probed(1, parts)?;
    Ok(())
}

fn by_parts(scene: Scene, torque: f64, n_drives: usize) -> Result<(), StepError> {
    let mut parts = Parts(Vec::with_capacity(1 << 17));
    let mut step = 0;
    let drives = drives(scene, torque, &StepOptions::default());
    for mut drive in drives.into_iter().take(n_drives) {
        for command in 0..drive.n_commands() {
            drive.give(command);
            for _ in 0..STEPS_A_COMMAND {
                step += 1;
                if step % EVERY == 0 {
                    counted_step(&mut drive.simulation, &mut parts)?;
                } else {
                    drive.simulation.step(1)?;
                }
            }
        }
    }
    println!("{}", step / EVERY);
    for phase in parts.0 {
        println!("{phase:?}");
    }
    Ok(())
}

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
    if let (Ok(steps), Some(scene)) = (word(0).parse(), Scene::of(word(1))) {
        let mut drives = drives(scene, TORQUE, &StepOptions::default());
        if word(2) == "batch" {
            in_batch(&drives, steps);
            return Ok(());
        }
        return alone(drives.swap_remove(0), steps);
    }
    let (Some(scene), Ok(torque), Ok(drives)) =
        (Scene::of(word(0)), word(1).parse(), word(2).parse())
    else {
        println!(
            "usage: explore_steps STEPS SCENE alone|batch, or explore_steps SCENE TORQUE DRIVES"
        );
        std::process::exit(2);
    };
    by_parts(scene, torque, drives)
}
