//! A drive in a curve, for counting instructions: `valgrind --tool=callgrind drive_steps 1000 [newton]`.
//!
//! Arguments: number of 5 ms steps (after 400 of run-in), and the variant.

use std::sync::Arc;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepError, StepOptions, Variant};
use rover_core::multibody::{Configuration, Model};
use rover_core::simulation::Simulation;

fn main() -> Result<(), StepError> {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments
        .get(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(1000);
    let is_newton = arguments.get(2).is_some_and(|v| v == "newton");
    let variant = if is_newton {
        Variant::Newton
    } else {
        Variant::Linearised
    };
    let model = Arc::new(Model::rover());
    let mut start = Configuration::zero(&model);
    start.position.y = 0.35;
    let options = StepOptions {
        variant,
        ..StepOptions::default()
    };
    let Ok(mut simulation) = Simulation::new(model.clone(), Arc::new(Plane::ground()), options)
    else {
        return Ok(());
    };
    simulation.set_state(start, vec![0.0; model.nv()]);
    let is_set = simulation
        .set_steering(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0])
        .is_ok()
        && simulation.set_wheel_torques(&[20.0; 6]).is_ok();
    simulation.step(400)?;
    let report = simulation.step(steps)?;
    std::process::exit(i32::from(!(is_set && report.is_converged())));
}
