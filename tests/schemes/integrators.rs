//! The time-stepping schemes of the comparison against closed forms and
//! against their textbook orders.

#![allow(clippy::unwrap_used)] // a test stops where a scene is impossible

use rover_comparison::measure::{
    BenchmarkMotion, ConvergenceCurve, accumulation, creep, drop_and_rest, elastic_change, end_of,
    order_across_impacts, order_in, reference, reference_scheme,
};
use rover_comparison::scenes::{G, ball_above, ball_on, flight_at, options};
use rover_comparison::{Penalty, SCHEMES, Scheme, SchemeFamily};
use rover_core::planar::Line;

/// Motions in persistent contact.
const ON_THE_GROUND: [BenchmarkMotion; 3] = [
    BenchmarkMotion::Rolling,
    BenchmarkMotion::Sliding,
    BenchmarkMotion::Driving,
];

fn named(start: &str) -> &'static Scheme {
    SCHEMES.iter().find(|s| s.name.starts_with(start)).unwrap()
}

/// Panics unless a number of a scheme is nearer to the expected one than the tolerance.
#[track_caller]
fn near(scheme: &Scheme, found: f64, expected: f64, tolerance: f64) {
    let off = (found - expected).abs();
    assert!(off < tolerance, "{}: {found} for {expected}", scheme.name);
}

fn check(scheme: &Scheme, curve: &ConvergenceCurve, expected: f64) {
    let order = curve.order().unwrap();
    assert!(
        (order - expected).abs() < 0.2,
        "{}: order {order:.3} instead of {expected}, {curve:?}",
        scheme.name
    );
}

#[test]
fn in_flight_every_scheme_has_its_order() {
    // Moreau–Jean with θ = ½, generalised-α, central differences 2; θ = 1
    // and semi-implicit Euler 1; Runge–Kutta 4.
    for scheme in &SCHEMES {
        let expected = match scheme.kind {
            SchemeFamily::MoreauJean { theta, .. } if theta > 0.5 => 1.0,
            SchemeFamily::Penalty(..) => 1.0,
            SchemeFamily::EventDriven => 4.0,
            _ => 2.0,
        };
        check(
            scheme,
            &order_in(scheme, BenchmarkMotion::Flight, 16).unwrap(),
            expected,
        );
    }
}

#[test]
fn across_impacts_every_scheme_is_of_first_order_and_the_event_driven_is_exact() {
    for scheme in &SCHEMES {
        let curve = order_across_impacts(scheme, 100);
        match scheme.kind {
            SchemeFamily::EventDriven => {
                let worst = curve.error.iter().map(|e| e.unwrap()).fold(0.0, f64::max);
                assert!(worst < 1e-9, "{curve:?}");
            }
            SchemeFamily::Penalty(..) => {}
            _ => check(scheme, &curve, 1.0),
        }
    }
}

#[test]
fn the_reference_agrees_with_itself_at_half_the_step() {
    for motion in ON_THE_GROUND {
        let (fine, coarse) = (
            reference(motion).unwrap(),
            end_of(&reference_scheme(), motion, 256).unwrap(),
        );
        let apart = fine
            .iter()
            .zip(&coarse)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(apart < 1e-8, "{motion:?}: {apart:e} m");
    }
}

#[test]
fn the_event_driven_scheme_says_that_it_cannot_pass_the_zeno_point() {
    // At rest from √(2 g₀/g) (1 + e)/(1 − e).
    let e = 0.5;
    let zeno = (2.0 / G).sqrt() * (1.0 + e) / (1.0 - e);
    let stopped = accumulation(e, 2.0).unwrap().unwrap();
    assert!(
        (stopped - zeno).abs() < 5e-3 && stopped <= zeno + 1e-9,
        "{stopped} {zeno}"
    );
    // Nothing is asserted before it.
    assert_eq!(accumulation(e, 1.3).unwrap(), None);
}

#[test]
fn the_others_pass_the_zeno_point_and_rest() {
    let e = 0.5;
    let zeno = (2.0 / G).sqrt() * (1.0 + e) / (1.0 - e);
    for scheme in &SCHEMES {
        if matches!(
            scheme.kind,
            SchemeFamily::EventDriven | SchemeFamily::Penalty(..)
        ) {
            continue;
        }
        let h = 1e-3;
        let mut simulation = ball_above(scheme, &options(0.0, e, h), 1.0).unwrap();
        let stepper = scheme.stepper(2.0, e);
        let mut last_move = 0.0;
        while simulation.time() < 2.0 {
            simulation.step_with(&stepper, 1).unwrap();
            if simulation.v()[1].abs() > 3.0 * G * h {
                last_move = simulation.time();
            }
        }
        near(scheme, last_move, zeno, 0.05);
        let v = simulation.v();
        let speed = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!(speed < 3.0 * G * h, "{}: {v:?}", scheme.name);
        assert!(simulation.gaps()[0].abs() < 1e-3);
    }
}

#[test]
fn a_sliding_ball_rolls_at_two_thirds_of_its_speed() {
    // Homogeneous disc: t* = v₀/(3 μ g), v₀ · 2/3.
    let (v0, mu, h) = (1.0, 0.3, 1e-3);
    for scheme in &SCHEMES {
        let level = Line::new(0.0, 0.0).unwrap();
        let start = ([0.0, 0.3], [v0, 0.0, 0.0]);
        let mut simulation =
            ball_on(scheme, &options(mu, 0.0, h), level, start.0, start.1).unwrap();
        let stepper = scheme.stepper(2.0, 0.0);
        let mut began = None;
        while simulation.time() < 0.5 {
            simulation.step_with(&stepper, 1).unwrap();
            let slip = simulation.v()[0] + 0.3 * simulation.v()[2];
            if slip.abs() < 2e-2 && began.is_none() {
                began = Some(simulation.time());
            }
        }
        let time = v0 / (3.0 * mu * G);
        near(scheme, began.unwrap(), time, 5e-3);
        near(scheme, simulation.v()[0], v0 * 2.0 / 3.0, 2e-2);
    }
}

#[test]
fn a_block_on_a_slope_stays_but_for_the_penalty_which_creeps() {
    // Regularised friction carries tan α only at the slip v_s tan α/√(μ² −
    // tan² α): closed form of the failure.
    let (alpha, mu) = (0.3_f64, 0.5_f64);
    for scheme in &SCHEMES {
        let speed = creep(scheme).unwrap();
        if let SchemeFamily::Penalty(_, slip_speed) = scheme.kind {
            let expected = slip_speed * alpha.tan() / (mu * mu - alpha.tan().powi(2)).sqrt();
            near(scheme, speed, expected, 0.01 * expected);
        } else {
            assert!(speed < 1e-10, "{}: {speed:e} m/s", scheme.name);
        }
    }
}

#[test]
fn the_penalty_scheme_breaks_down_above_the_step_that_its_stiffness_allows() {
    // Undamped semi-implicit Euler is stable up to 2 √(m/k), whatever happens in the scene.
    let (mass, stiffness) = (2.0_f64, 1e5_f64);
    let limit = 2.0 * (mass / stiffness).sqrt();
    let largest = |h: f64| {
        let base = options(0.0, 1.0, h);
        let rest = -mass * G / stiffness;
        let mut simulation = ball_above(named("Penalty"), &base, 1.1 * rest).unwrap();
        let stepper = Penalty {
            stiffness,
            damping: 0.0,
            slip_speed: 1e-2,
        };
        let mut largest = 0.0_f64;
        for _ in 0..2000 {
            simulation.step_with(&stepper, 1).unwrap();
            largest = largest.max((simulation.q()[1] - 0.3 - rest).abs());
        }
        largest / -rest
    };
    assert!(largest(0.9 * limit) < 1.0, "{}", largest(0.9 * limit));
    assert!(largest(1.1 * limit) > 10.0, "{}", largest(1.1 * limit));
}

#[test]
fn bounces_without_loss_keep_the_energy_but_for_what_damps() {
    for scheme in &SCHEMES {
        let change = elastic_change(scheme, 20.0).unwrap();
        match scheme.kind {
            // θ = 1 falls by g h more than it should in each step, and loses it at the impact; the
            // penalty's impact is resolved by its step.
            SchemeFamily::MoreauJean { theta, .. } if theta > 0.5 => {
                assert!(change < -1e-4, "{change}");
            }
            SchemeFamily::Penalty(..) => assert!(change.abs() > 1e-4, "{change}"),
            _ => assert!(change.abs() < 1e-10, "{}: {change:e}", scheme.name),
        }
    }
}

#[test]
fn what_drops_without_restitution_rests() {
    for scheme in &SCHEMES {
        let (growth, rest) = drop_and_rest(scheme).unwrap();
        assert!(rest < 1e-9, "{}: {rest:e} m/s", scheme.name);
        assert!(
            growth < 1e-5 || matches!(scheme.kind, SchemeFamily::Penalty(..)),
            "{growth:e}"
        );
    }
}

#[test]
fn in_persistent_contact_each_has_its_order() {
    // The textbook's Moreau–Jean is of order 1; contacts at the end of the
    // step with the reaction's mean direction make it 2.
    for scheme in &SCHEMES {
        let expected = match scheme.kind {
            SchemeFamily::MoreauJean { theta, .. } if theta > 0.5 => 1.0,
            SchemeFamily::MoreauJean { .. } | SchemeFamily::GeneralisedAlpha(_) => 2.0,
            SchemeFamily::SchatzmanPaoli => 1.0,
            SchemeFamily::EventDriven => 4.0,
            SchemeFamily::Penalty(..) => continue,
        };
        // Our scheme halves its coarsest steps from rest, which would blur the slope.
        let coarsest = match scheme.kind {
            SchemeFamily::MoreauJean { .. } => 32,
            _ => 16,
        };
        for motion in ON_THE_GROUND {
            let curve = order_in(scheme, motion, coarsest).unwrap();
            check(scheme, &curve, expected);
        }
    }
}

#[test]
fn the_penalty_scheme_converges_to_another_motion() {
    // Refining sixteen times, from 0.16 ms to 0.01 ms, gains nothing: the remaining error is that
    // of the spring and the regularised friction.
    let curve = order_in(named("Penalty"), BenchmarkMotion::Driving, 4096).unwrap();
    let errors: Vec<f64> = curve.error.iter().map(|e| e.unwrap()).collect();
    assert!(
        errors[4] > 0.8 * errors[0] && errors[4] > 1e-3,
        "{errors:?}"
    );
}

#[test]
fn the_closed_form_of_the_flight_starts_where_the_flight_does() {
    let simulation = rover_comparison::scenes::flight(named("Event"), 1e-3).unwrap();
    let difference = |(q, expected): (&f64, &f64)| (q - expected).abs();
    let start = flight_at(0.0).unwrap();
    let off = simulation.q().iter().zip(&start).map(difference);
    assert!(off.fold(0.0, f64::max) < 1e-13);
    let dt = 1e-6;
    let rate = (flight_at(dt).unwrap() - flight_at(-dt).unwrap()) / (2.0 * dt);
    let errors = simulation
        .v()
        .iter()
        .zip(&rate)
        .map(|(v, rate)| (v - rate).abs());
    assert!(errors.fold(0.0, f64::max) < 1e-7);
}
