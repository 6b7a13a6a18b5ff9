//! Machines, grounds and starts that the tests share.

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::geometry::Plane;
use rover_core::integrator::{Stabilisation, StepOptions, StepReport, Variant};
use rover_core::multibody::{Hold, Model, ModelDescription, coordinates};
use rover_core::simulation::RoverSimulation;

/// Both time-stepping schemes.
pub const VARIANTS: [Variant; 2] = [Variant::Linearised, Variant::Newton];

/// A golden file, parsed.
pub fn golden(name: &str) -> serde_json::Value {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/golden")
        .join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Numbers of any nesting, flattened.
pub fn numbers(value: &serde_json::Value) -> Vec<f64> {
    match value {
        serde_json::Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// A simulation of a model on a plane, at public coordinates q and velocity v.
pub fn simulation(
    model: Model,
    plane: Plane,
    options: StepOptions,
    q: &[f64],
    v: &[f64],
) -> RoverSimulation {
    let mut simulation = RoverSimulation::new(Arc::new(model), Arc::new(plane), options).unwrap();
    let configuration = coordinates::from_public(simulation.model(), q).unwrap();
    simulation.set_state(configuration, v.to_vec());
    simulation
}

/// The rover at rest on flat ground, touching it.
pub fn at_rest(options: StepOptions) -> RoverSimulation {
    let mut q = [0.0; 21];
    q[1] = 0.35;
    simulation(Model::rover(), Plane::ground(), options, &q, &[0.0; 21])
}

/// The rover on a slope that rises along x, touching it.
pub fn on_slope(degrees: f64, options: StepOptions) -> RoverSimulation {
    let a = degrees.to_radians();
    let mut q = [0.0; 21];
    (q[0], q[1], q[5]) = (-0.35 * a.sin(), 0.35 * a.cos(), a);
    simulation(Model::rover(), slope(degrees), options, &q, &[0.0; 21])
}

/// A plane through the origin that rises along x.
pub fn slope(degrees: f64) -> Plane {
    let a = degrees.to_radians();
    Plane::new([-a.sin(), a.cos(), 0.0], 0.0).unwrap()
}

/// The machine of the report's run on the plane: 880 kg table, contact radius 0.30 m, gains of 1.5,
/// torques independent of speed.
pub fn report_machine() -> Model {
    let masses = numbers(&golden("rover_model.json")["meta"]["masses_880"]);
    let mut description = ModelDescription::rover();
    for (solid, mass) in description.solids.iter_mut().zip(masses) {
        solid.mass = mass;
    }
    set_steering_gains(&mut description, 1.5, 1.5);
    set_contact_radius(&mut description, 0.30);
    without_motors(description)
}

/// The machine of the independent check: contact radius 0.20 m, gains of 15000, steering mass
/// centres 7.5 cm low, torques independent of speed.
pub fn check_machine() -> Model {
    let mut description = ModelDescription::rover();
    set_steering_gains(&mut description, 15_000.0, 15_000.0);
    set_contact_radius(&mut description, 0.20);
    for solid in &mut description.solids {
        if solid.name.starts_with("steering") {
            solid.centre_of_mass = Some([0.0, -0.075, 0.0]);
        }
    }
    without_motors(description)
}

fn without_motors(description: ModelDescription) -> Model {
    let model = Model::from_description(description).unwrap();
    model.with_motors(None).unwrap()
}

/// The radius at which the wheels touch; their discs stay.
pub fn set_contact_radius(description: &mut ModelDescription, radius: f64) {
    for wheel in &mut description.wheels {
        wheel.contact_radius = Some(radius);
    }
}

fn set_steering_gains(description: &mut ModelDescription, stiffness: f64, damping: f64) {
    for solid in &mut description.solids {
        if solid.name.starts_with("steering") {
            solid.hold = Some(Hold { stiffness, damping });
        }
    }
}

/// The report's section 6.1, motors on.
pub fn report_scene(
    variant: Variant,
    time_step: f64,
    stabilisation: Stabilisation,
) -> RoverSimulation {
    let plane = Plane::new(
        [
            -0.099_334_665_397_530_61,
            0.990_033_288_920_620_5,
            0.099_833_416_646_828_17,
        ],
        0.0,
    )
    .unwrap();
    let gravity = Vector3::new(0.0, -0.0981, 0.0);
    let options = StepOptions {
        variant,
        time_step,
        stabilisation,
        gravity,
        restitution: 0.3,
        ..StepOptions::default()
    };
    let mut q = [0.0; 21];
    (q[1], q[7], q[8]) = (0.955, -0.1, -0.1);
    let mut simulation = simulation(report_machine(), plane, options, &q, &[0.0; 21]);
    simulation
        .set_steering(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0])
        .unwrap();
    // +0.2 N m about the wheel axes, which drives towards −x
    simulation.set_wheel_torques(&[-0.2; 6]).unwrap();
    simulation
}

/// The drive of the independent check: displacement (m) and heading (rad)
/// after 10 s, and the report of all steps.
pub fn check_drive(variant: Variant, h: f64) -> (Vector3<f64>, f64, StepReport) {
    let mut q = [0.0; 21];
    q[1] = 0.50;
    let options = StepOptions {
        variant,
        time_step: h,
        ..StepOptions::default()
    };
    let mut simulation = simulation(check_machine(), Plane::ground(), options, &q, &[0.0; 21]);
    let mut report = simulation.step(count(2.0, h)).unwrap();
    let start = simulation.q().position;
    simulation
        .set_steering(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0])
        .unwrap();
    simulation.set_wheel_torques(&[20.0; 6]).unwrap();
    report.merge(&simulation.step(count(10.0, h)).unwrap());
    let end = simulation.q();
    let heading = coordinates::to_public(simulation.model(), end)[4];
    (end.position - start, heading, report)
}

/// Steps of `h` in so many seconds.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded, positive, small
pub fn count(seconds: f64, h: f64) -> usize {
    (seconds / h).round() as usize
}

/// Slope of log(error) over log(h) by least squares.
pub fn order(steps: &[f64], errors: &[f64]) -> f64 {
    let n = steps.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = steps
        .iter()
        .zip(errors)
        .map(|(h, e)| (h.ln(), e.ln()))
        .unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let covariance: f64 = x.iter().zip(&y).map(|(a, b)| (a - mx) * (b - my)).sum();
    covariance / x.iter().map(|a| (a - mx).powi(2)).sum::<f64>()
}
