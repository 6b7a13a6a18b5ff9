//! Orders of convergence with contacts: halve the step, fit the slope.

use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::Model;

use super::scenes::{VARIANTS, count, order};
use crate::shared::{flat, resting};

/// L1 error of the height over half a second of a drop, one to three
/// bounces included (e = 0.5, no friction).
///
/// The rover falls flat, so all wheels strike together and the exact motion is a bouncing ball's.
fn bouncing_error(variant: Variant, h: f64, clearance: f64) -> f64 {
    let options = StepOptions {
        variant,
        time_step: h,
        restitution: 0.5,
        friction_coefficient: 0.0,
        ..StepOptions::default()
    };
    let mut simulation = resting(Model::rover(), flat(), options, |q| {
        q.position.y = 0.35 + clearance;
    });
    let mut sum = 0.0;
    let n = count(0.5, h);
    for _ in 0..n {
        simulation.step(1).unwrap();
        let height = simulation.q().position.y - 0.35;
        sum += h * (height - bouncing_ball(clearance, 0.5, simulation.time())).abs();
    }
    sum
}

/// Height of a bouncing ball released at rest: free fall, then flights of `v e^k`.
fn bouncing_ball(clearance: f64, e: f64, t: f64) -> f64 {
    let g = 9.81;
    let first = (2.0 * clearance / g).sqrt();
    if t <= first {
        return clearance - 0.5 * g * t * t;
    }
    let (mut start, mut speed) = (first, e * g * first);
    while speed > 1e-9 {
        let flight = 2.0 * speed / g;
        if t <= start + flight {
            let s = t - start;
            return speed * s - 0.5 * g * s * s;
        }
        start += flight;
        speed *= e;
    }
    0.0
}

#[test]
fn first_order_through_impacts() {
    // The error of one trajectory is erratic, since it depends on the phase of the impact within
    // the step: average over 16 heights.
    for variant in VARIANTS {
        let steps = [0.01, 0.005, 0.0025, 0.00125];
        let errors = steps.map(|h| {
            (0..16)
                .map(|k| bouncing_error(variant, h, 0.2 + 0.0137 * f64::from(k)))
                .sum::<f64>()
        });
        let slope = order(&steps, &errors);
        assert!(slope > 0.9, "{variant:?}: order {slope}, {errors:?}");
    }
}

#[test]
fn elastic_bounces_keep_their_energy_at_any_step() {
    for h in [0.001, 0.005, 0.02] {
        let options = StepOptions {
            time_step: h,
            restitution: 1.0,
            friction_coefficient: 0.0,
            ..StepOptions::default()
        };
        let mut simulation = resting(Model::rover(), flat(), options, |q| q.position.y = 0.85);
        let before = simulation.energy().total();
        let mut largest = 0.0_f64;
        for _ in 0..count(5.0, h) {
            simulation.step(1).unwrap();
            // ½ (v_k² + …) at the nodes of a parabola is exact; only the
            // impact's phase is of order h
            largest = largest.max((simulation.energy().total() - before).abs());
        }
        assert!(largest < 1e-9 * before, "h = {h}: {largest} J of {before}");
    }
}
