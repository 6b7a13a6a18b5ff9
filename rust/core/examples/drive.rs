//! Ten seconds of a drive in a curve: where the rover is, and with what force its wheels stand.
#![allow(clippy::print_stdout)] // its purpose
use std::error::Error;
use std::sync::Arc;

use rover_core::contact::placement::resting_pose;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, coordinates};
use rover_core::simulation::RoverSimulation;

fn main() -> Result<(), Box<dyn Error>> {
    let (model, ground) = (Arc::new(Model::rover()), Plane::ground());
    let standing = resting_pose(&model, &ground, [0.0, 0.0], 0.0)?; // at x = z = 0, heading along x
    let mut rover = RoverSimulation::new(model.clone(), Arc::new(ground), StepOptions::default())?;
    rover.set_state(
        coordinates::from_public(&model, &standing)?,
        vec![0.0; model.nv()],
    );
    rover.set_wheel_torques(&[20.0; 6])?; // N m
    rover.set_steering(&[0.1, 0.1, 0.0, 0.0, 0.0, 0.0])?; // rad
    for second in 1..=10 {
        let report = rover.step(200)?; // of 5 ms
        let [x, _, z] = rover.state().configuration.position.into();
        let load: f64 = rover.wheel_forces().iter().map(|force| force[0]).sum();
        println!(
            "{second:2} s: x {x:6.3} m, z {z:6.3} m, on the wheels {load:6.1} N, solved {}",
            report.is_converged()
        );
    }
    Ok(())
}
