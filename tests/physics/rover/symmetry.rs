//! Rotating the whole scene about gravity rotates the answer; a mirror image moves as a mirror
//! image.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::simulation::RoverSimulation;

use crate::shared::resting;

fn driving(heading: f64, steering: f64) -> RoverSimulation {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
    let n = turn * Vector3::new(-0.1, 1.0, 0.0);
    let plane = Plane::new(n.into(), 0.0).unwrap();
    let options = StepOptions::default();
    let mut simulation = resting(Model::rover(), Arc::new(plane), options, |q| {
        q.position = turn * Vector3::new(0.0, 0.5, 0.0);
        q.attitude = turn;
    });
    simulation
        .set_steering(&[steering, steering, 0.0, -steering, 0.0, -steering])
        .unwrap();
    simulation.set_wheel_torques(&[60.0; 6]).unwrap();
    simulation.step(600).unwrap();
    simulation
}

#[test]
fn turning_the_scene_turns_the_answer() {
    let straight = driving(0.0, 0.2);
    for heading in [0.7, std::f64::consts::FRAC_PI_2, 3.0, -2.0] {
        let turned = driving(heading, 0.2);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
        let expected = turn * straight.q().position;
        let miss = (turned.q().position - expected).norm();
        assert!(
            miss < 1e-6 && expected.norm() > 2.0,
            "heading {heading}: {miss} m over {} m",
            expected.norm()
        );
        let attitude = turn * straight.q().attitude;
        assert!(turned.q().attitude.angle_to(&attitude) < 1e-6);
    }
}

#[test]
fn steering_left_is_the_mirror_image_of_steering_right() {
    let (left, right) = (driving(0.0, 0.2), driving(0.0, -0.2));
    let (a, b) = (left.q().position, right.q().position);
    assert!(
        (a.x - b.x).abs() < 1e-6 && (a.y - b.y).abs() < 1e-6 && (a.z + b.z).abs() < 1e-6,
        "{a} {b}"
    );
    assert!(a.z.abs() > 0.1);
}
