//! Steps of a rover whose policy explores, for counting the instructions of each part of a step:
//! `explore_steps GROUND TORQUE DRIVES` under
//! `valgrind --tool=callgrind --collect-atstart=no --toggle-collect='*counted_step*'
//! --dump-before='*part_ends*'`.
//!
//! It plays the first DRIVES drives of `benchmarks/comparison/exploring.json` (GROUND: `plane`,
//! `rocks`, `plane, wheels 0.20 m`, `plane, cylinders`, `plane, tori`) with torques of up to TORQUE
//! N m, and counts every seventh step. Each part of a counted step ends with a call of `part_ends`,
//! at which callgrind writes what the part took. The number of counted steps is printed, and the
//! names of the parts in the same order, one a line. `make bench` adds them up.

#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use exploring_scenes::{Ground, STEPS_A_COMMAND, drives};
use rover_core::integrator::{Phase, Probe, StepError, StepOptions};
use rover_core::simulation::RoverSimulation;

/// Every how many-th step is counted: prime to the steps of a command, so that each of them comes
/// up.
const EVERY: usize = 7;

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

/// The only code that is counted.
#[inline(never)]
fn counted_step(simulation: &mut RoverSimulation, parts: &mut Parts) -> Result<(), StepError> {
    simulation.step_probed(1, parts)?;
    Ok(())
}

fn main() -> Result<(), StepError> {
    let arguments: Vec<String> = std::env::args().collect();
    let ground = arguments.get(1).and_then(|name| Ground::of(name));
    let torque = arguments.get(2).and_then(|t| t.parse().ok());
    let n_drives = arguments.get(3).and_then(|n| n.parse().ok());
    let (Some(ground), Some(torque), Some(n_drives)) = (ground, torque, n_drives) else {
        println!("usage: explore_steps GROUND TORQUE DRIVES");
        std::process::exit(2);
    };
    let mut parts = Parts(Vec::with_capacity(1 << 17));
    let mut step = 0;
    let drives = drives(ground, torque, &StepOptions::default());
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
