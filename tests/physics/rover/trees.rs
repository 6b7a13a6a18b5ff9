//! Other machines with the same code.

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Model, ModelDescription};

use super::scenes::simulation;

const CART: &str = r#"
name = "cart"
[[solids]]
name = "frame"
mass = 20.0
shape = { kind = "box", size = [1.0, 0.1, 0.5] }
[[solids]]
name = "front"
parent = "frame"
position = [0.4, -0.1, 0.0]
axis = [0.0, 0.0, 2.0]
mass = 2.0
shape = { kind = "disc", radius = 0.2 }
[[solids]]
name = "rear_left"
parent = "frame"
position = [-0.4, -0.1, -0.25]
axis = [0.0, 0.1, 1.0]
mass = 2.0
shape = { kind = "disc", radius = 0.2 }
[[solids]]
name = "rear_right"
parent = "frame"
position = [-0.4, -0.1, 0.25]
axis = [0.0, 0.0, 1.0]
mass = 2.0
shape = { kind = "disc", radius = 0.2 }
[[wheels]]
name = "F"
solid = "front"
axle = [0.0, 0.0, 1.0]
radius = 0.2
torque_limit = 5.0
drive_sign = -1.0
[[wheels]]
name = "L"
solid = "rear_left"
axle = [0.0, 0.0, 1.0]
radius = 0.2
torque_limit = 5.0
drive_sign = -1.0
[[wheels]]
name = "R"
solid = "rear_right"
axle = [0.0, 0.0, 1.0]
radius = 0.2
torque_limit = 5.0
drive_sign = -1.0
"#;

fn cart() -> ModelDescription {
    ModelDescription::from_toml(CART).unwrap()
}

#[test]
fn a_cart_with_three_wheels_and_a_tilted_joint_drives() {
    let model = Model::from_description(cart()).unwrap();
    assert_eq!(model.nv(), 9);
    let mut q = [0.0; 9];
    q[1] = 0.31;
    let mut simulation = simulation(
        model,
        Plane::ground(),
        StepOptions::default(),
        &q,
        &[0.0; 9],
    );
    // beyond its limit of 5 N m the motor saturates
    simulation.set_wheel_torques(&[2.0, 2.0, 50.0]).unwrap();
    assert!((simulation.wheel_torques()[2] - 5.0).abs() < 1e-15);
    simulation.set_wheel_torques(&[2.0; 3]).unwrap();
    assert!(simulation.step(400).unwrap().is_converged());
    assert!(simulation.q().position.x > 1.0);
}

#[test]
fn a_free_top_precesses_as_the_closed_form_says() {
    // Axisymmetric body, I = (a, c, a) about y, spin w: in the body the
    // cross rate turns with (c − a)/a w.
    let text = "name = 'top'\n[[solids]]\nname = 'top'\nmass = 1.0\nshape = { kind = 'cylinder', radius = 0.3, height = 0.2 }";
    let model = Model::from_description(ModelDescription::from_toml(text).unwrap()).unwrap();
    let (a, c) = ((3.0 * 0.09 + 0.04) / 12.0, 0.045);
    let (w, cross, T): (f64, f64, f64) = (5.0, 0.5, 2.0);
    let options = StepOptions {
        gravity: Vector3::zeros(),
        time_step: 0.0005,
        variant: Variant::Newton,
        ..StepOptions::default()
    };
    let mut simulation = simulation(
        model,
        Plane::ground(),
        options,
        &[0.0, 9.0, 0.0, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0, cross, w, 0.0],
    );
    simulation.step(4000).unwrap();
    // Space frame: the body turns about the constant angular momentum L
    // at |L|/a, and about its own axis at −(c − a)/a w.
    let L = Vector3::new(a * cross, c * w, 0.0);
    let about_L = UnitQuaternion::from_scaled_axis(L * (T / a));
    let about_axis = UnitQuaternion::from_scaled_axis(Vector3::y() * (-(c - a) / a * w * T));
    let error = simulation.q().attitude.angle_to(&(about_L * about_axis));
    assert!(error < 1e-5, "{error} rad");
}
