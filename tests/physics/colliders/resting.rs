//! Each collider comes to rest on level ground, with its weight on its contacts, and stays on a
//! slope that it does not roll down.

use rover_core::integrator::Variant;
use rover_core::multibody::Configuration;

use super::collider_scenes::{GRAVITY, STEP, body, placed, prism, take};
use crate::shared::{VARIANTS, largest, near_in};

const CYLINDER: &str = "kind = 'cylinder', radius = 0.2, height = 0.3";
const CAPSULE: &str = "kind = 'capsule', radius = 0.1, height = 0.4";
const ELLIPSOID: &str = "kind = 'ellipsoid', radii = [0.3, 0.1, 0.2]";
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

#[test]
fn dropped_with_a_tilt_it_lies_at_its_height_and_bears_its_weight() {
    let prism = prism();
    let cases: [(&str, [f64; 3], f64, usize); 6] = [
        (CYLINDER, [0.03, 0.0, 0.05], 0.15, 3),
        (CYLINDER, [QUARTER + 0.02, 0.0, 0.0], 0.2, 2),
        (CAPSULE, [0.0, 0.3, QUARTER + 0.1], 0.1, 2),
        (ELLIPSOID, [0.05, 0.0, 0.05], 0.1, 1),
        (&prism, [0.1, 0.4, 0.05], 0.1, 6),
        (&prism, [QUARTER, 0.0, 0.1], 0.25 * 0.75_f64.sqrt(), 4),
    ];
    for variant in VARIANTS {
        for (shape, turn, height, n_contacts) in cases {
            let start = [0.0, height + 0.06, 0.0];
            let mut simulation = placed(body(shape), start, turn, 0.0, variant);
            // An ellipsoid rocks: nothing but impacts dissipates.
            let steps = if shape == ELLIPSOID { 100 } else { 800 };
            take(&mut simulation, steps);
            let centre = simulation.q().position.y;
            if shape == ELLIPSOID {
                assert!(centre > height - 2e-4, "{centre}");
            } else {
                let energy = simulation.energy();
                assert!(energy.kinetic < 1e-6, "{shape} {turn:?}: {energy:?}");
                assert!((centre - height).abs() < 2e-4, "{shape} {turn:?}: {centre}");
                let n = simulation.contacts().len();
                assert!(n >= n_contacts, "{shape} {turn:?}: {n} contacts");
                let contacts = simulation.contacts().iter();
                let force: f64 = contacts.map(|a| a.impulse[0] / STEP).sum();
                assert!((force - 4.0 * GRAVITY).abs() < 1e-3, "{shape}: {force}");
            }
        }
    }
}

#[test]
fn on_a_slope_it_stays_where_its_side_is_flat_and_slides_where_friction_ends() {
    let prism = prism();
    for (shape, height) in [(CYLINDER, 0.15), (&prism, 0.1)] {
        for slope in [0.3, 0.7] {
            let mut simulation = placed(
                body(shape),
                [0.0, height, 0.0],
                [0.0; 3],
                slope,
                Variant::Newton,
            );
            if slope < 0.7_f64.atan() {
                take(&mut simulation, 400);
                let place = simulation.q().position;
                assert!(place.x.abs() < 1e-3, "{shape}: {place}");
                let v = largest(simulation.v());
                assert!(v < 1e-6, "{shape}: {v}");
            } else {
                // a = g (sin − μ cos)
                simulation.step(200).unwrap();
                let v = GRAVITY * (slope.sin() - 0.7 * slope.cos());
                near_in(&shape, simulation.v()[0], v, 0.02 * v);
            }
        }
    }
}

/// A rod that stands on its end falls, and nothing of it goes through the ground.
#[test]
fn a_falling_rod_ends_on_its_side() {
    for shape in [
        "kind = 'cylinder', radius = 0.03, height = 0.8",
        "kind = 'capsule', radius = 0.03, height = 0.74",
    ] {
        let start = [0.0, 0.4, 0.0];
        let mut simulation = placed(body(shape), start, [0.05, 0.0, 0.2], 0.0, Variant::Newton);
        take(&mut simulation, 600);
        let Configuration {
            position, attitude, ..
        } = simulation.q();
        assert!((position.y - 0.03).abs() < 2e-4, "{position}");
        let axis = attitude * rover_core::nalgebra::Vector3::y();
        assert!(axis.y.abs() < 1e-3, "{axis}");
    }
}
