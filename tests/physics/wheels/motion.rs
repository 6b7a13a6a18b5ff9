//! How rovers on wide wheels rest, lean and drive.

use std::sync::Arc;

use rover_core::contact::Part;
use rover_core::geometry::{Plane, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use super::wheel_scenes::{lone, wide_rover};
use crate::rover::scenes::VARIANTS;
use crate::shared::{flat, in_public, largest, near, near_in, stepping};
use crate::spheres::sphere_scenes::{WHEEL_MASS, WHEEL_RADIUS, placed};
use crate::surfaces::surface_scenes::map;

/// The rover's place on level ground, in public coordinates.
fn standing() -> [f64; 21] {
    std::array::from_fn(|k| if k == 1 { 0.35 } else { 0.0 })
}

/// Normal forces on the wheels of a rover that has stood for a while on a plane that falls to the
/// right by `slope` rad.
fn loads(slope: f64) -> Vec<f64> {
    let plane = Plane::new([0.0, slope.cos(), slope.sin()], 0.0).unwrap();
    let mut q = standing();
    q[3] = slope;
    let mut rover = in_public(wide_rover(0.2, 0.02), Arc::new(plane), &q);
    assert!(rover.step(400).unwrap().is_converged());
    rover.wheel_forces().iter().map(|force| force[0]).collect()
}

#[test]
fn the_loads_of_a_resting_rover_do_not_jump_with_its_lean() {
    let upright = loads(0.0);
    let weight: f64 = upright.iter().sum();
    let expected = Model::rover().mass() * 9.81;
    near(weight / expected, 1.0, 1e-2);
    for slope in [-1e-6, 1e-6] {
        for (load, flat) in loads(slope).iter().zip(&upright) {
            near_in(&slope, *load, *flat, 1e-3 * weight);
        }
    }
}

#[test]
fn a_cylinder_stands_on_two_points_without_rocking() {
    for variant in VARIANTS {
        let options = stepping(variant, 0.005);
        let start = Vector3::new(0.0, WHEEL_RADIUS, 0.0);
        let mut wheel = placed(lone(0.08, 0.01), Plane::ground(), options.clone(), start);
        for _ in 0..20 {
            wheel.step(20).unwrap();
            let speed = largest(wheel.v());
            assert!(speed < 1e-9, "{variant:?}: {speed}");
        }
        let parts: Vec<Part> = wheel.contacts().iter().map(|c| c.contact.part).collect();
        assert_eq!(parts, [Part::Wheel(0); 2]);
        let weight = WHEEL_MASS * 9.81 * options.time_step;
        for contact in wheel.contacts() {
            near(contact.impulse[0] / (0.5 * weight), 1.0, 1e-3);
        }
    }
}

#[test]
fn a_torus_stands_on_one_point() {
    let start = Vector3::new(0.0, WHEEL_RADIUS, 0.0);
    let wheel = lone(0.08, 0.04);
    let mut wheel = placed(wheel, Plane::ground(), StepOptions::default(), start);
    wheel.step(10).unwrap();
    assert_eq!(wheel.contacts().len(), 1);
}

#[test]
fn a_cylinder_that_leans_falls_back_on_its_tread() {
    let start = Vector3::new(0.0, WHEEL_RADIUS + 0.02, 0.0);
    let wheel = lone(0.08, 0.0);
    let mut wheel = placed(wheel, Plane::ground(), StepOptions::default(), start);
    let mut q = wheel.q().clone();
    q.attitude = UnitQuaternion::from_euler_angles(0.3, 0.0, 0.0);
    wheel.set_state(q, vec![0.0; 6]);
    wheel.step(600).unwrap();
    let axle = wheel.q().attitude * Vector3::z();
    // Where a step ends within the last of its impacts, it comes to rest.
    assert!(axle.y.abs() < 1e-3, "{axle}");
    let speed = largest(wheel.v());
    assert!(speed < 1e-9, "{speed}");
    let y = wheel.q().position.y;
    assert!((y - WHEEL_RADIUS).abs() < 1e-4, "{y}");
}

/// Positions of a rover that drives and turns for a second.
fn drive(model: Model, terrain: Arc<dyn Terrain>, steering: [f64; 6]) -> Vec<Vector3<f64>> {
    let mut rover = in_public(model, terrain, &standing());
    rover.step(100).unwrap();
    rover.set_steering(&steering).unwrap();
    rover.set_wheel_torques(&[20.0; 6]).unwrap();
    let place = |rover: &RoverSimulation| rover.q().position;
    (0..40)
        .map(|_| {
            assert!(rover.step(10).unwrap().is_converged());
            place(&rover)
        })
        .collect()
}

#[test]
fn a_width_that_vanishes_gives_the_motion_of_thin_discs() {
    let steering = [-0.2, -0.2, 0.0, 0.0, 0.1, 0.1];
    let bumpy = |x: f64, z: f64| 0.05 * ((2.0 * x).sin() + (3.0 * z).cos());
    let grounds: [Arc<dyn Terrain>; 2] = [flat(), Arc::new(map(100, 0.2, bumpy))];
    for ground in grounds {
        let thin = drive(Model::rover(), Arc::clone(&ground), steering);
        for (width, rounding) in [(2e-6, 0.0), (2e-6, 1e-6)] {
            let wide = drive(wide_rover(width, rounding), Arc::clone(&ground), steering);
            let differences = thin.iter().zip(&wide).map(|(a, b)| (a - b).norm());
            let error = differences.fold(0.0, f64::max);
            assert!(error < 1e-4, "{width} {rounding}: {error}");
        }
    }
}

#[test]
fn a_rover_on_wide_wheels_drives_straight_and_turns() {
    let ground = flat();
    for rounding in [0.0, 0.04, 0.08] {
        let straight = drive(wide_rover(0.16, rounding), Arc::clone(&ground), [0.0; 6]);
        let end = straight.last().unwrap();
        assert!(end.x > 0.5 && end.z.abs() < 1e-6, "{rounding}: {end}");
        let steering = [0.3, 0.3, 0.0, -0.3, 0.0, -0.3];
        let turned = drive(wide_rover(0.16, rounding), Arc::clone(&ground), steering);
        let (end, thin) = (
            turned.last().unwrap(),
            drive(Model::rover(), Arc::clone(&ground), steering),
        );
        let thin = thin.last().unwrap();
        assert!(
            thin.z.abs() > 0.05 && (end - thin).norm() < 0.2,
            "{end} {thin}"
        );
    }
}
