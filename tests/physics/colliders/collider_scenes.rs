//! Single bodies of a shape on a plane.

use std::sync::Arc;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Configuration, Model, ModelDescription};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

pub const GRAVITY: f64 = 9.81;
pub const STEP: f64 = 0.005;

/// A prism with six sides of 0.25 m and a height of 0.2 m along y.
pub fn prism() -> String {
    let corners: Vec<String> = (0..6)
        .flat_map(|k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_3 * f64::from(k)).sin_cos();
            [-0.1, 0.1].map(|y| format!("[{}, {y}, {}]", 0.25 * cos, 0.25 * sin))
        })
        .collect();
    format!("kind = 'hull', points = [{}]", corners.join(", "))
}

/// A free body of 4 kg with one collider.
pub fn body(shape: &str) -> Model {
    let text = format!(
        "name = 'machine'\n[[solids]]\nname = 'body'\nmass = 4.0\n\
         shapes = [{{ {shape}, collides = true }}]\n"
    );
    Model::from_description(ModelDescription::from_toml(&text).unwrap()).unwrap()
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
    let mut start = Configuration::zero(&model);
    start.position = place.into();
    start.attitude = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    let v = vec![0.0; model.nv()];
    let options = StepOptions {
        variant,
        gravity: Vector3::new(GRAVITY * slope.sin(), -GRAVITY * slope.cos(), 0.0),
        time_step: STEP,
        ..StepOptions::default()
    };
    let ground = Arc::new(Plane::ground());
    let mut simulation = RoverSimulation::new(Arc::new(model), ground, options).unwrap();
    simulation.set_state(start, v);
    simulation
}

/// Takes steps in which no energy may be created.
pub fn take(simulation: &mut RoverSimulation, steps: usize) {
    let mut before = simulation.energy();
    for step in 0..steps {
        let report = simulation.step(1).unwrap();
        assert!(report.is_converged(), "{step}: {report:?}");
        let energy = simulation.energy();
        let gain = energy.kinetic + energy.potential - before.kinetic - before.potential;
        assert!(gain < 1e-6 + report.energy_lifted, "{step}: {gain}");
        before = energy;
    }
}
