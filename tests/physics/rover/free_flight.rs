//! Nothing but gravity: momenta, energy, orders.

use nalgebra::Vector3;
use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Model, coordinates};
use rover_core::simulation::Simulation;

use crate::scenes::{VARIANTS, count, order, simulation};

/// The rover tumbling high above the ground with all joints turning.
fn tumbling(variant: Variant, time_step: f64, gravity: Vector3<f64>) -> Simulation {
    let options = StepOptions {
        variant,
        time_step,
        gravity,
        ..StepOptions::default()
    };
    let mut q = [0.0; 21];
    q[1] = 1000.0;
    let mut v = [0.0; 21];
    v[..6].copy_from_slice(&[1.0, 2.0, -0.5, 0.8, -1.1, 0.6]);
    for (k, rate) in v.iter_mut().enumerate().skip(6) {
        *rate = 1.5 * (k as f64).sin();
    }
    let mut simulation = simulation(Model::rover(), Plane::ground(), options, &q, &v);
    let joints: Vec<String> = simulation
        .model()
        .bodies()
        .iter()
        .skip(1)
        .map(|b| b.name.clone())
        .collect();
    simulation.release(&joints).unwrap();
    simulation
}

#[test]
fn momenta_are_conserved_to_rounding() {
    let mut simulation = tumbling(Variant::Newton, 0.005, Vector3::zeros());
    let before = simulation.momentum();
    assert!(simulation.step(400).unwrap().is_converged());
    let after = simulation.momentum();
    assert!((after.linear - before.linear).norm() < 1e-12 * before.linear.norm());
    assert!((after.angular - before.angular).norm() < 1e-12 * before.angular.norm());
}

#[test]
fn in_gravity_momenta_grow_by_the_weight_and_its_moment() {
    let gravity = Vector3::new(0.3, -9.81, -0.2);
    let mut simulation = tumbling(Variant::Newton, 0.005, gravity);
    let weight = gravity * simulation.model().mass();
    let (mut linear, mut angular) = (simulation.momentum().linear, simulation.momentum().angular);
    for _ in 0..400 {
        let centre = simulation.centre_of_mass();
        simulation.step(1).unwrap();
        linear += weight * 0.005;
        angular += ((centre + simulation.centre_of_mass()) * 0.5).cross(&weight) * 0.005;
    }
    let after = simulation.momentum();
    assert!((after.linear - linear).norm() < 1e-12 * linear.norm());
    assert!((after.angular - angular).norm() < 1e-12 * angular.norm());
}

#[test]
fn energy_error_is_of_second_order() {
    for variant in VARIANTS {
        let steps = [0.02, 0.01, 0.005, 0.0025];
        let drift = steps.map(|h| {
            let mut simulation = tumbling(variant, h, Vector3::new(0.0, -9.81, 0.0));
            let before = simulation.energy().total();
            simulation.step(count(2.0, h)).unwrap();
            (simulation.energy().total() - before).abs()
        });
        let slope = order(&steps, &drift);
        assert!(slope > 1.9, "{variant:?}: order {slope}, drift {drift:?}");
        // relative to 2.3 kJ of kinetic energy
        assert!(drift[2] < 0.2, "{variant:?}: {drift:?}");
    }
}

#[test]
fn trajectories_converge_with_second_order() {
    for variant in VARIANTS {
        let end = |h: f64| {
            let mut simulation = tumbling(variant, h, Vector3::new(0.0, -9.81, 0.0));
            simulation.step(count(1.0, h)).unwrap();
            coordinates::to_public(&simulation.state().configuration)
        };
        let reference = end(1.0 / 12800.0);
        let steps = [1.0 / 50.0, 1.0 / 100.0, 1.0 / 200.0, 1.0 / 400.0];
        let errors = steps.map(|h| {
            let q = end(h);
            q.iter()
                .zip(&reference)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt()
        });
        let slope = order(&steps, &errors);
        assert!(slope > 1.9, "{variant:?}: order {slope}, errors {errors:?}");
    }
}
