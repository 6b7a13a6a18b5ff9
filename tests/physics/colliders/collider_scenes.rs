//! Single bodies of a shape on a plane.

use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::Model;
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use crate::shared::{flat, resting, step_without_gain, stepping};

pub const GRAVITY: f64 = 9.81;
pub const STEP: f64 = 0.005;

/// A prism with six sides of 0.25 m and a height of 0.2 m along y.
pub fn prism() -> String {
    crate::shared::prism(0.25, 0.1)
}

/// A free body of 4 kg with one collider.
pub fn body(shape: &str) -> Model {
    crate::shared::body(4.0, &format!("shapes = [{{ {shape}, collides = true }}]"))
}

/// A body at a place (m), turned by a rotation vector (rad), on a plane that rises along −x by an
/// angle (rad).
pub fn placed(
    model: Model,
    place: [f64; 3],
    turn: [f64; 3],
    slope: f64,
    variant: Variant,
) -> RoverSimulation {
    let options = StepOptions {
        gravity: Vector3::new(GRAVITY * slope.sin(), -GRAVITY * slope.cos(), 0.0),
        ..stepping(variant, STEP)
    };
    resting(model, flat(), options, |q| {
        q.position = place.into();
        q.attitude = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    })
}

/// Takes steps in which no energy may be created.
pub fn take(simulation: &mut RoverSimulation, steps: usize) {
    for _ in 0..steps {
        step_without_gain(simulation, 1e-6);
    }
}
