//! Whole behaviour of the core: laws, closed forms, recorded references and invariants.
//!
//! One program, so that the core is linked once.

use rover_core::integrator::{StepOptions, Variant};
use rover_core::simulation::RoverSimulation;

mod among_grains;
mod colliders;
mod contacts;
mod exploring_scenes;
mod grains;
mod joints;
mod lanes;
mod materials;
mod planar;
mod rolling;
mod rover;
mod rover_kinds;
mod sand;
mod shapes;
mod spheres;
mod surfaces;
mod vessels;
mod wheels;

/// Default options with a variant and a time step, s.
fn stepping(variant: Variant, time_step: f64) -> StepOptions {
    StepOptions {
        variant,
        time_step,
        ..StepOptions::default()
    }
}

/// Names of all joints of a rover but its base.
fn joints(rover: &RoverSimulation) -> Vec<String> {
    let bodies = rover.model().bodies();
    bodies[1..].iter().map(|body| body.name.clone()).collect()
}
