//! No wide wheel falls or drives through a stone or a map.

use rover_core::geometry::Terrain;
use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;

use super::wheel_scenes::lone;
use crate::rover::scenes::VARIANTS;
use crate::spheres::sphere_scenes::{Random, WHEEL_RADIUS, deepest, field, placed};
use crate::surfaces::surface_scenes::map;

const R: f64 = WHEEL_RADIUS;

/// Width and rounding of the wheels, m.
const RIMS: [(f64, f64); 3] = [(0.08, 0.0), (0.08, 0.02), (0.05, 0.025)];

#[test]
fn a_wheel_at_five_metres_a_second_strikes_every_stone_from_where_it_comes() {
    for (width, rounding) in RIMS {
        let mut random = Random(5);
        for case in 0..100 {
            let radius = random.between(0.004, 0.1);
            let options = StepOptions {
                variant: VARIANTS[case % 2],
                gravity: Vector3::zeros(),
                friction_coefficient: 0.0,
                ..StepOptions::default()
            };
            let stone = field(&[[0.0, 0.0, 0.0, radius]]);
            let across = if case % 3 == 0 {
                random.between(-1.0, 1.0)
            } else {
                0.0
            };
            let (x, y) = (random.between(-1.0, 1.0), random.between(-1.0, 1.0));
            let aim = Vector3::new(x, y, across).normalize();
            let start = aim * -(R + width + radius + random.between(0.02, 0.1));
            let mut wheel = placed(lone(width, rounding), stone, options, start);
            let still = wheel.state().configuration.clone();
            let v = aim * 5.0;
            wheel.set_state(still, vec![v.x, v.y, v.z, 0.0, 0.0, 0.0]);
            for _ in 0..20 {
                wheel.step(1).unwrap();
                if !wheel.contacts().is_empty() {
                    break;
                }
            }
            let struck = wheel.contacts();
            assert_eq!(struck.len(), 1, "{width} {rounding}, case {case}: passed");
            let n = struck[0].contact.frame.n;
            assert!(n.dot(&aim) < -0.05, "case {case}: n {n} for {aim}");
            let x = wheel.state().configuration.position;
            assert!(x.dot(&aim) < 0.02, "case {case}, radius {radius}: at {x}");
        }
    }
}

#[test]
fn a_wheel_dropped_from_two_metres_at_20_ms_lands_on_stones_and_maps() {
    for (width, rounding) in RIMS {
        for (k, variant) in VARIANTS.into_iter().enumerate() {
            for phase in 0..8 {
                let options = StepOptions {
                    time_step: 0.02,
                    variant,
                    ..StepOptions::default()
                };
                let start = Vector3::new(
                    0.013 * f64::from(phase),
                    2.0 + 0.012 * f64::from(phase),
                    0.007 * f64::from(phase),
                );
                let mut random = Random(k as u64 + 1);
                let heights: Vec<f64> = (0..41 * 41).map(|_| 0.03 * random.uniform()).collect();
                let bumps = map(40, 0.06, |x, z| {
                    let index = |x: f64| (x / 0.06).round() + 20.0;
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a node
                    heights[(index(z) * 41.0 + index(x)) as usize]
                });
                let mut wheel = placed(lone(width, rounding), bumps, options.clone(), start);
                wheel.step(50).unwrap();
                assert!(deepest(&wheel) > -0.3 * R, "{width}: {}", deepest(&wheel));
                assert!(wheel.state().configuration.position.y > 0.0);

                let stone = field(&[[0.0, 0.0, 0.0, 0.06]]);
                let start = Vector3::new(0.0, start.y, start.z);
                let mut wheel = placed(lone(width, rounding), stone, options, start);
                let mut has_struck = false;
                for _ in 0..40 {
                    wheel.step(1).unwrap();
                    has_struck |= !wheel.contacts().is_empty();
                    assert!(deepest(&wheel) > -0.3 * 0.06, "{}", deepest(&wheel));
                    if has_struck {
                        break;
                    }
                }
                assert!(has_struck, "{width} {rounding} {variant:?} {phase}");
                assert!(-wheel.state().v[1] < 5.0, "{}", wheel.state().v[1]);
            }
        }
    }
}

#[test]
fn a_wheel_at_five_metres_a_second_stays_above_bumps() {
    for (width, rounding) in RIMS {
        let bumps = |x: f64, z: f64| 0.02 * ((23.0 * x).sin() + (31.0 * z).cos());
        let field = map(200, 0.05, bumps);
        let low = field.clone();
        let start = Vector3::new(-2.0, 0.3, 0.0);
        let mut wheel = placed(lone(width, rounding), field, StepOptions::default(), start);
        let still = wheel.state().configuration.clone();
        wheel.set_state(still, vec![5.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        for _ in 0..150 {
            wheel.step(1).unwrap();
            let x = wheel.state().configuration.position;
            let ground = low.height(x.x, x.z).unwrap();
            assert!(x.y > ground, "{x} under {ground}");
        }
    }
}
