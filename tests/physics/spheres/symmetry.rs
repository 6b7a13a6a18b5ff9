//! Invariance under the order of the spheres, the heading of the scene, and reflection.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::simulation::RoverSimulation;

use super::sphere_scenes::Random;
use crate::shared::resting;

/// Spheres for a drive along x, drawn with the rover's own track: every
/// sphere in reach of a wheel sooner or later.
fn stones(seed: u64) -> Vec<[f64; 4]> {
    let mut random = Random(seed);
    (0..120)
        .map(|_| {
            let radius = random.between(0.02, 0.06);
            [
                random.between(0.9, 6.0),
                random.between(-0.6, 0.2) * radius,
                random.between(-0.8, 0.8),
                radius,
            ]
        })
        .collect()
}

/// The rover driven over stones; the whole scene turned about gravity by `heading`.
fn driven(stones: &[[f64; 4]], heading: f64, steps: usize) -> RoverSimulation {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
    let centres: Vec<[f64; 3]> = stones
        .iter()
        .map(|s| (turn * Vector3::new(s[0], s[1], s[2])).into())
        .collect();
    let radii: Vec<f64> = stones.iter().map(|s| s[3]).collect();
    let field = SphereField::new(&centres, &radii, Some(Plane::ground())).unwrap();
    let options = StepOptions::default();
    let mut simulation = resting(Model::rover(), Arc::new(field), options, |q| {
        q.position = turn * Vector3::new(0.0, 0.35, 0.0);
        q.attitude = turn;
    });
    simulation.set_wheel_torques(&[35.0; 6]).unwrap();
    simulation.step(steps).unwrap();
    simulation
}

#[test]
fn the_order_of_the_spheres_does_not_matter() {
    let mut stones = stones(3);
    let straight = driven(&stones, 0.0, 400);
    stones.reverse();
    stones.swap(10, 50);
    let permuted = driven(&stones, 0.0, 400);
    let (a, b) = (straight.state(), permuted.state());
    let miss = (a.configuration.position - b.configuration.position).norm();
    assert!(
        a.configuration.position.x > 0.5,
        "{}",
        a.configuration.position
    );
    assert!(miss < 1e-6, "{miss} m");
}

#[test]
fn turning_the_scene_turns_the_answer() {
    let stones = stones(4);
    let straight = driven(&stones, 0.0, 400);
    for heading in [0.7, 3.0] {
        let turned = driven(&stones, heading, 400);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
        let expected = turn * straight.q().position;
        let miss = (turned.q().position - expected).norm();
        assert!(
            miss < 1e-5 && expected.norm() > 0.5,
            "heading {heading}: {miss} m"
        );
    }
}

#[test]
fn a_mirror_symmetric_rover_on_a_mirror_symmetric_field_stays_so() {
    // Every stone beside its mirror image in z; the machine is symmetric, and so are its torques.
    let half = stones(5);
    let both: Vec<[f64; 4]> = half
        .iter()
        .flat_map(|s| [*s, [s[0], s[1], -s[2], s[3]]])
        .collect();
    let rover = driven(&both, 0.0, 400);
    let state = rover.state();
    let position = state.configuration.position;
    assert!(position.x > 0.4, "{position}");
    assert!(position.z.abs() < 1e-6, "{position}");
    let lean = state.configuration.attitude * Vector3::z();
    assert!((lean - Vector3::z()).norm() < 1e-6, "{lean}");
    let joints = &state.configuration.joints;
    let name = |n: &str| joints[rover.model().joint_index(n).unwrap()];
    assert!((name("left_bogie") - name("right_bogie")).abs() < 1e-6);
    assert!(name("front_axle").abs() < 1e-6);
}

#[test]
fn far_spheres_are_not_looked_at() {
    // The same spot in fields of 100 m² and 100 000 m²: not one visit more.
    let count = |side: u32| {
        let mut centres: Vec<[f64; 3]> = Vec::new();
        let mut random = Random(1);
        let n = 2 * side * side;
        for i in 0..n {
            // near ones first, the same in both fields
            let reach = if i < 200 { 5.0 } else { f64::from(side) };
            let mut x = Vector3::new(
                random.between(-reach, reach),
                0.0,
                random.between(-reach, reach),
            );
            if i >= 200 && x.amax() < 5.0 {
                x.x += 10.0;
            }
            centres.push(x.into());
        }
        let field = SphereField::new(&centres, &vec![0.1; centres.len()], None).unwrap();
        let mut visits = 0;
        for i in 0..20 {
            let centre = Vector3::new(0.2 * f64::from(i) - 2.0, 0.1, 0.5);
            field.visit_near(&centre, 0.3, &mut |_, _| visits += 1);
        }
        visits
    };
    let near = count(10);
    assert!(near > 0);
    assert_eq!(near, count(220));
}
