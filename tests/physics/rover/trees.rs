//! Other machines with the same code.

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Configuration, Model};

use crate::shared::{body, flat, model, moving, resting, stepping};

/// Three driven wheels on a frame, the left one of which turns about a tilted axis.
fn cart() -> Model {
    let wheel = |name: &str, place: [f64; 3], axis: [f64; 3]| {
        format!(
            r#"
[[solids]]
name = "wheel {name}"
parent = "frame"
position = {place:?}
axis = {axis:?}
mass = 2.0
shape = {{ kind = "disc", radius = 0.2 }}
[[wheels]]
name = "{name}"
solid = "wheel {name}"
axle = [0.0, 0.0, 1.0]
radius = 0.2
torque_limit = 5.0
drive_sign = -1.0
"#
        )
    };
    let frame = r#"
name = "cart"
[[solids]]
name = "frame"
mass = 20.0
shape = { kind = "box", size = [1.0, 0.1, 0.5] }
"#;
    let wheels = [
        wheel("F", [0.4, -0.1, 0.0], [0.0, 0.0, 2.0]),
        wheel("L", [-0.4, -0.1, -0.25], [0.0, 0.1, 1.0]),
        wheel("R", [-0.4, -0.1, 0.25], [0.0, 0.0, 1.0]),
    ];
    model(&[frame, &wheels.concat()].concat())
}

#[test]
fn a_cart_with_three_wheels_and_a_tilted_joint_drives() {
    let model = cart();
    assert_eq!(model.nv(), 9);
    let mut simulation = resting(model, flat(), StepOptions::default(), |q| {
        q.position.y = 0.31;
    });
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
    let model = body(
        1.0,
        "shape = { kind = 'cylinder', radius = 0.3, height = 0.2 }",
    );
    let (a, c) = ((3.0 * 0.09 + 0.04) / 12.0, 0.045);
    let (w, cross, T): (f64, f64, f64) = (5.0, 0.5, 2.0);
    let options = StepOptions {
        gravity: Vector3::zeros(),
        ..stepping(Variant::Newton, 0.0005)
    };
    let mut start = Configuration::zero(&model);
    start.position.y = 9.0;
    let v = vec![0.0, 0.0, 0.0, cross, w, 0.0];
    let mut simulation = moving(model, flat(), options, start, v);
    simulation.step(4000).unwrap();
    // Space frame: the body turns about the constant angular momentum L
    // at |L|/a, and about its own axis at −(c − a)/a w.
    let L = Vector3::new(a * cross, c * w, 0.0);
    let about_L = UnitQuaternion::from_scaled_axis(L * (T / a));
    let about_axis = UnitQuaternion::from_scaled_axis(Vector3::y() * (-(c - a) / a * w * T));
    let error = simulation.q().attitude.angle_to(&(about_L * about_axis));
    assert!(error < 1e-5, "{error} rad");
}
