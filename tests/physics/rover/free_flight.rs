//! Nothing but gravity: momenta, energy, orders.

use nalgebra::Vector3;
use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Model, coordinates};
use rover_core::simulation::RoverSimulation;

use super::scenes::{VARIANTS, count, order, simulation};
use crate::shared::{joints, stepping};

/// The rover tumbling high above the ground with all joints turning.
fn tumbling(variant: Variant, time_step: f64, gravity: Vector3<f64>) -> RoverSimulation {
    let options = StepOptions {
        gravity,
        ..stepping(variant, time_step)
    };
    let mut q = [0.0; 21];
    q[1] = 1000.0;
    let mut v = [0.0; 21];
    v[..6].copy_from_slice(&[1.0, 2.0, -0.5, 0.8, -1.1, 0.6]);
    for (k, rate) in v.iter_mut().enumerate().skip(6) {
        *rate = 1.5 * (k as f64).sin();
    }
    let mut simulation = simulation(Model::rover(), Plane::ground(), options, &q, &v);
    let joints = joints(&simulation);
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
fn energy_stays_or_swings_with_second_order() {
    let drift = |variant: Variant, h: f64| {
        let mut simulation = tumbling(variant, h, Vector3::new(0.0, -9.81, 0.0));
        let before = simulation.energy().total();
        simulation.step(count(2.0, h)).unwrap();
        (simulation.energy().total() - before).abs()
    };
    // Rounding, for 2.3 kJ of kinetic and 9.4 MJ of potential energy.
    for h in [0.08, 0.02, 0.005] {
        let drift = drift(Variant::Linearised, h);
        assert!(drift < 1e-6, "step {h}: {drift}");
    }
    let steps = [0.02, 0.01, 0.005, 0.0025];
    let drift = steps.map(|h| drift(Variant::Newton, h));
    let slope = order(&steps, &drift);
    assert!(slope > 1.9, "order {slope}, drift {drift:?}");
    assert!(drift[2] < 0.2, "{drift:?}");
}

/// With a spin of 5 rad/s and a step of 84 ms the explicit gyroscopic terms went to 1e82 J; with
/// wheels at 5600 rad/s and 5 ms to 1e152 J.
#[test]
fn no_spin_and_no_step_add_energy() {
    for time_step in [1e-3, 5e-3, 0.02, 0.084, 0.1] {
        for (base, joints, wheels) in [
            (5.0, 0.0, 0.0),
            (0.5, 0.1, 5600.0),
            (3.0, 30.0, 1e4),
            (1e4, 1e4, 1e4),
        ] {
            for variant in VARIANTS {
                let mut simulation = tumbling(variant, time_step, Vector3::zeros());
                let mut v = simulation.v().to_vec();
                for (k, v) in v.iter_mut().enumerate().skip(3) {
                    let body = &simulation.model().bodies()[simulation.model().body_of_velocity(k)];
                    let rate = match (k < 6, body.is_spinner) {
                        (true, _) => base,
                        (false, true) => wheels,
                        (false, false) => joints,
                    };
                    *v = rate * (1.3 * k as f64).sin();
                }
                let start = simulation.q().clone();
                simulation.set_state(start, v);
                for step in 0..100 {
                    let before = simulation.energy();
                    simulation.step(1).unwrap();
                    let after = simulation.energy();
                    let gained = after.total() - before.total();
                    // That of the Newton variant oscillates without drift as long as frames rotate
                    // by less than 0.1 rad per step.
                    let allowed = match variant {
                        Variant::Linearised => 1e-9,
                        Variant::Newton => 1e-3,
                    };
                    assert!(
                        gained <= allowed * before.kinetic,
                        "{variant:?}, {time_step} s, {base} {joints} {wheels} rad/s, step {step}: {gained} of {before:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn trajectories_converge_with_second_order() {
    for variant in VARIANTS {
        let end = |h: f64| {
            let mut simulation = tumbling(variant, h, Vector3::new(0.0, -9.81, 0.0));
            simulation.step(count(1.0, h)).unwrap();
            coordinates::to_public(simulation.model(), simulation.q())
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
