//! Parked: loads on the flat, no creep on slopes, the slide beyond the friction angle.

use nalgebra::Vector3;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, ModelDescription};

use super::scenes::{VARIANTS, at_rest, on_slope, simulation};
use crate::shared::{largest, near_in, stepping};

/// Closed form, N: front (trunk 40/102 + group)/2, side (trunk 62/204 +
/// group)/2, group = axle or bogie + 2 steering + 2 wheels.
const FRONT: f64 = 9.81 * (600.0 * 40.0 / 102.0 + 120.0) / 2.0;
const SIDE: f64 = 9.81 * (600.0 * 62.0 / 204.0 + 120.0) / 2.0;

#[test]
fn loads_on_the_flat_are_the_closed_form() {
    assert!((FRONT - 1742.718).abs() < 1e-3 && (SIDE - 1483.041).abs() < 1e-3);
    for variant in VARIANTS {
        let mut simulation = at_rest(stepping(variant, 0.005));
        simulation.brake();
        for steps in [1, 1, 2000] {
            assert!(simulation.step(steps).unwrap().is_converged());
            for (i, force) in simulation.wheel_forces().iter().enumerate() {
                let expected = if i < 2 { FRONT } else { SIDE };
                near_in(&(variant, i), force[0], expected, 1e-6 * expected);
                // no spurious squeeze between wheels that stand straight
                assert!(
                    force[1].hypot(force[2]) < 1e-4,
                    "{variant:?}, wheel {i}: {force:?}"
                );
            }
        }
        assert!(simulation.v().iter().all(|v| v.abs() < 1e-12));
    }
}

#[test]
fn loads_of_a_step_in_parts_add_up_to_the_weight() {
    // A step is split where a frame turns by more than 0.5 rad; the loads were those of the last
    // part, a half, a third or a quarter. A wheel that is not round in its inertia is such a frame.
    let mut description = ModelDescription::rover();
    for solid in &mut description.solids {
        if solid.name.starts_with("wheel") {
            let across = 0.25 * solid.mass * 0.01;
            solid.inertia = Some([across, 1.01 * across, 2.0 * across, 0.0, 0.0, 0.0]);
        }
    }
    for wheel in &mut description.wheels {
        wheel.motor = None;
    }
    let model = Model::from_description(description).unwrap();
    let (mut q, mut v) = ([0.0; 21], [0.0; 21]);
    q[1] = 0.35;
    for (turn, parts) in [(0.4, 1), (0.9, 2), (1.4, 3), (1.9, 4), (9.8, 20)] {
        let options = StepOptions {
            friction_coefficient: 0.0,
            ..StepOptions::default()
        };
        for wheel in model.wheels() {
            v[model.bodies()[wheel.body].velocity] = turn / options.time_step;
        }
        let mut rover = simulation(model.clone(), Plane::ground(), options, &q, &v);
        for steps in [1, 1, 20] {
            rover.step(steps).unwrap();
            assert_eq!(rover.contacts().len(), 6);
            for (i, force) in rover.wheel_forces().iter().enumerate() {
                let expected = if i < 2 { FRONT } else { SIDE };
                near_in(&(parts, i), force[0], expected, 1e-6 * expected);
            }
        }
    }
}

#[test]
fn braked_on_a_slope_it_does_not_creep() {
    for degrees in [15.0, 25.0, 30.0, 34.9] {
        let mut simulation = on_slope(degrees, StepOptions::default());
        simulation.brake();
        simulation.step(2000).unwrap();
        let before = simulation.q().position;
        assert!(simulation.step(10_000).unwrap().is_converged());
        let creep = (simulation.q().position - before).norm() / 50.0;
        assert!(creep < 1e-9, "{degrees} degrees: {creep} m/s");
        let v = simulation.v();
        assert!(largest(v) < 1e-8, "{degrees} degrees: {v:?}");
    }
}

#[test]
fn beyond_the_friction_angle_it_slides_as_coulomb_says() {
    // a = g (sin α − μ cos α), all six wheels locked by their brakes
    for degrees in [35.1, 36.0, 40.0] {
        let a: f64 = f64::to_radians(degrees);
        let expected = 9.81 * (a.sin() - 0.7 * a.cos());
        let mut simulation = on_slope(degrees, StepOptions::default());
        simulation.brake();
        simulation.step(200).unwrap();
        let speed = |v: &[f64]| Vector3::new(v[0], v[1], v[2]).norm();
        let before = speed(simulation.v());
        simulation.step(200).unwrap();
        let acceleration = speed(simulation.v()) - before;
        near_in(&degrees, acceleration, expected, 1e-6 * expected.max(0.1));
    }
}
