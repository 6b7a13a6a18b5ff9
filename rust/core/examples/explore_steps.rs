//! Steps of a rover whose policy explores, for counting the instructions of each part of a step:
//! `explore_steps GROUND TORQUE EVERY` under
//! `valgrind --tool=callgrind --collect-atstart=no --toggle-collect='*counted_step*'
//! --dump-before='*part_ends*'`.
//!
//! It plays the drives of `tests/comparison/exploring.json` (GROUND: `plane`, `rocks`,
//! `plane, wheels 0.20 m`) with torques of up to TORQUE N m, and counts every EVERY-th step. Each
//! part of a counted step ends with a call of `part_ends`, at which callgrind writes what the part
//! took; the names of the parts are printed in the same order, one a line. `make bench` adds them
//! up.

#![allow(clippy::print_stdout)] // its purpose

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use exploring_scenes::{Ground, STEPS_A_COMMAND, drives};
use rover_core::integrator::{Phase, Probe, StepError, StepOptions};
use rover_core::simulation::RoverSimulation;

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
    let every: Option<usize> = arguments.get(3).and_then(|n| n.parse().ok());
    let (Some(ground), Some(torque), Some(every)) = (ground, torque, every) else {
        println!("usage: explore_steps GROUND TORQUE EVERY");
        std::process::exit(2);
    };
    let mut parts = Parts(Vec::with_capacity(1 << 17));
    let mut step = 0;
    for mut drive in drives(ground, torque, &StepOptions::default()) {
        for command in 0..drive.n_commands() {
            drive.give(command);
            for _ in 0..STEPS_A_COMMAND {
                step += 1;
                if step % every == 0 {
                    counted_step(&mut drive.simulation, &mut parts)?;
                } else {
                    drive.simulation.step(1)?;
                }
            }
        }
    }
    for phase in parts.0 {
        println!("{phase:?}");
    }
    Ok(())
}
