//! A wheel at rest on one, two and three spheres, with the load split that statics gives.
//!
//! A lone disc stands in the plane of its axle's normal: on one sphere it balances, on two in its
//! plane it is wedged, on three it is wedged and leans. Friction is zero where the problem would
//! otherwise be statically indeterminate.

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::contact::{Contact, Opposite};
use rover_core::integrator::StepOptions;
use rover_core::simulation::RoverSimulation;

use super::sphere_scenes::{WHEEL_MASS, WHEEL_RADIUS, field, lone_wheel, placed};
use crate::rover::scenes::VARIANTS;
use crate::shared::{near, stepping};

const R: f64 = WHEEL_RADIUS;
const G: f64 = 9.81;

/// Number of the ground's primitive under a contact.
fn primitive(contact: &Contact) -> u32 {
    match contact.key.opposite {
        Opposite::Ground(primitive) => primitive,
        Opposite::Part(_) | Opposite::Grain(_) | Opposite::Stop => {
            panic!("a lone wheel touches only the ground")
        }
    }
}

/// Mean normal forces of the last step by primitive, N.
fn normal_forces(simulation: &RoverSimulation) -> Vec<(u32, f64)> {
    let h = simulation.options().time_step;
    let mut forces: Vec<(u32, f64)> = simulation
        .contacts()
        .iter()
        .map(|a| (primitive(&a.contact), a.impulse[0] / h))
        .collect();
    forces.sort_by_key(|f| f.0);
    forces
}

#[test]
fn on_the_crest_of_one_sphere_it_carries_its_weight() {
    for variant in VARIANTS {
        let options = stepping(variant, 0.005);
        let sphere = field(&[[0.0, 0.0, 0.0, 0.5]]);
        let start = Vector3::new(0.0, 0.5 + R, 0.0);
        let mut wheel = placed(lone_wheel(), sphere, options, start);
        // Balanced upright: a rounding error grows with e^(10 t).
        assert!(wheel.step(40).unwrap().is_converged());
        let forces = normal_forces(&wheel);
        assert_eq!(forces.len(), 1);
        assert!((forces[0].1 - WHEEL_MASS * G).abs() < 1e-6);
        assert!((wheel.q().position - start).norm() < 1e-9);
    }
}

#[test]
fn wedged_between_two_spheres_each_carries_its_share_of_the_triangle_of_forces() {
    // Two spheres of different size at the same distance below on both sides,
    // in the wheel's plane. With normals at angles α and β from the vertical,
    // N_1 = m g sin β / sin(α + β), N_2 = m g sin α / sin(α + β).
    for variant in VARIANTS {
        for (alpha, beta, r1, r2) in [(0.6_f64, 0.6_f64, 0.2, 0.2), (0.9, 0.4, 0.05, 0.3)] {
            let options = StepOptions {
                variant,
                friction_coefficient: 0.0,
                ..StepOptions::default()
            };
            let (d1, d2) = (R + r1, R + r2);
            let ground = field(&[
                [-d1 * alpha.sin(), -d1 * alpha.cos(), 0.0, r1],
                [d2 * beta.sin(), -d2 * beta.cos(), 0.0, r2],
            ]);
            let mut wheel = placed(lone_wheel(), ground, options, Vector3::zeros());
            assert!(wheel.step(40).unwrap().is_converged());
            let forces = normal_forces(&wheel);
            assert_eq!(forces.len(), 2, "one contact a sphere");
            let total = WHEEL_MASS * G / (alpha + beta).sin();
            near(forces[0].1, total * beta.sin(), 1e-6);
            near(forces[1].1, total * alpha.sin(), 1e-6);
            assert!(wheel.q().position.norm() < 1e-8);
        }
    }
}

#[test]
fn lying_on_three_spheres_each_carries_a_third() {
    // The face of a disc that lies flat, on three equal spheres at 120 degrees: m g / 3 each. With
    // two of them at 90 degrees to the third's opposite, moments about the centre give shares in
    // proportion to 1 : 1/√2 : 1/√2 of the distances.
    for variant in VARIANTS {
        for directions in [[0.0, 120.0, 240.0], [0.0, 135.0, 225.0]] {
            let options = stepping(variant, 0.005);
            let places: Vec<Vector3<f64>> = directions
                .iter()
                .map(|d: &f64| {
                    let a = d.to_radians();
                    Vector3::new(a.cos(), 0.0, a.sin()) * (0.6 * R)
                })
                .collect();
            let spheres: Vec<_> = places.iter().map(|p| [p.x, -0.2, p.z, 0.2]).collect();
            let ground = field(&spheres);
            let mut wheel = placed(lone_wheel(), ground, options, Vector3::zeros());
            let mut flat = wheel.q().clone();
            flat.attitude =
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            wheel.set_state(flat, vec![0.0; 6]);
            assert!(wheel.step(40).unwrap().is_converged());
            let forces = normal_forces(&wheel);
            assert_eq!(forces.len(), 3);
            // Σ N_i p_i = 0 and Σ N_i = m g decide the three.
            let sum: Vector3<f64> = forces.iter().zip(&places).map(|((_, n), p)| p * *n).sum();
            let total: f64 = forces.iter().map(|f| f.1).sum();
            assert!(
                sum.norm() < 1e-6 && (total - WHEEL_MASS * G).abs() < 1e-6,
                "{forces:?}"
            );
            let last = wheel.q().position;
            assert!(last.norm() < 1e-8, "{variant:?}: {last}");
        }
    }
}

#[test]
fn wedged_between_three_spheres_the_triangle_is_a_pyramid() {
    // Two spheres ahead of the wheel, mirror images about its plane, and one behind: the pair
    // shares evenly what one in the plane would carry.
    let (alpha, beta, r, side) = (0.6_f64, 0.6_f64, 0.2, 0.05_f64);
    let d = R + r;
    let (x, y) = (d * beta.sin(), -d * beta.cos());
    // The rim point E = R (sin β, −cos β) must be at the distance r of each
    // centre: pull them in along the same direction.
    let along = R + (r * r - side * side).sqrt();
    let (px, py) = (x * along / d, y * along / d);
    let ground = field(&[
        [-d * alpha.sin(), -d * alpha.cos(), 0.0, r],
        [px, py, side, r],
        [px, py, -side, r],
    ]);
    let options = StepOptions {
        friction_coefficient: 0.0,
        ..StepOptions::default()
    };
    let mut wheel = placed(lone_wheel(), ground, options, Vector3::zeros());
    assert!(wheel.step(20).unwrap().is_converged());
    let forces = normal_forces(&wheel);
    assert_eq!(forces.len(), 3);
    let total = WHEEL_MASS * G / (alpha + beta).sin();
    near(forces[0].1, total * beta.sin(), 1e-6);
    // The in-plane part of each of the pair's normals is cos of its lean, √(1 − (side/r)²).
    let each = total * alpha.sin() / (2.0 * (1.0 - (side / r).powi(2)).sqrt());
    near(forces[1].1, each, 1e-6);
    near(forces[2].1, each, 1e-6);
}
