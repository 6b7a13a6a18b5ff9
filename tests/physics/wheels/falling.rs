//! No wheel, thin or wide, falls or drives through a stone or a map.

use rover_core::geometry::Terrain;
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::nalgebra::Vector3;

use super::wheel_scenes::lone;
use crate::rover::scenes::VARIANTS;
use crate::shared::stepping;
use crate::spheres::sphere_scenes::{Random, WHEEL_RADIUS, deepest, field, lone_wheel, placed};
use crate::surfaces::falling::bumpy;

const R: f64 = WHEEL_RADIUS;

/// Widths of the wheels, m, and the wheels: a thin disc, a cylinder, and two with rounded edges.
fn wheels() -> [(f64, Model); 4] {
    let wide = |width, rounding| (width, lone(width, rounding));
    let thin = (0.0, lone_wheel());
    [thin, wide(0.08, 0.0), wide(0.08, 0.02), wide(0.05, 0.025)]
}

#[test]
fn a_wheel_at_five_metres_a_second_strikes_every_stone_from_where_it_comes() {
    for (width, model) in wheels() {
        let mut random = Random(5);
        for case in 0..300 {
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
            let mut wheel = placed(model.clone(), stone, options, start);
            let still = wheel.q().clone();
            let v = aim * 5.0;
            wheel.set_state(still, vec![v.x, v.y, v.z, 0.0, 0.0, 0.0]);
            for _ in 0..20 {
                wheel.step(1).unwrap();
                if !wheel.contacts().is_empty() {
                    break;
                }
            }
            let struck = wheel.contacts();
            assert_eq!(struck.len(), 1, "{width}, case {case}: passed");
            let n = struck[0].contact.frame.n;
            assert!(n.dot(&aim) < -0.05, "case {case}: n {n} for {aim}");
            let x = wheel.q().position;
            assert!(x.dot(&aim) < 0.02, "case {case}, radius {radius}: at {x}");
        }
    }
}

#[test]
fn a_wheel_dropped_from_two_metres_at_20_ms_lands_on_stones_and_maps() {
    for (width, model) in wheels() {
        for variant in VARIANTS {
            for phase in 0..8_u32 {
                let options = stepping(variant, 0.02);
                let start = Vector3::new(
                    0.013 * f64::from(phase),
                    2.0 + 0.012 * f64::from(phase),
                    0.007 * f64::from(phase),
                );
                let spacing = [0.03, 0.1, 0.4][phase as usize % 3];
                let bumps = bumpy(u64::from(phase) + 1, spacing, 0.5 * spacing);
                let mut wheel = placed(model.clone(), bumps, options.clone(), start);
                wheel.step(50).unwrap();
                assert!(deepest(&wheel) > -0.3 * R, "{width}: {}", deepest(&wheel));
                assert!(wheel.q().position.y > 0.0);

                let stone = field(&[[0.0, 0.0, 0.0, 0.06]]);
                let start = Vector3::new(0.0, start.y, start.z.min(width));
                let mut wheel = placed(model.clone(), stone, options, start);
                let mut has_struck = false;
                for _ in 0..40 {
                    wheel.step(1).unwrap();
                    has_struck |= !wheel.contacts().is_empty();
                    assert!(deepest(&wheel) > -0.3 * 0.06, "{}", deepest(&wheel));
                    if has_struck {
                        break;
                    }
                }
                assert!(has_struck, "{width} {variant:?} {phase}");
                assert!(-wheel.v()[1] < 5.0, "{}", wheel.v()[1]);
            }
        }
    }
}

#[test]
fn a_wheel_at_five_metres_a_second_stays_above_bumps() {
    for (width, model) in wheels() {
        for (seed, spacing) in [(4, 0.05), (5, 0.15), (6, 0.3)] {
            for heading in [0.0_f64, 0.4, 0.9] {
                let bumps = bumpy(seed, spacing, 0.3 * spacing);
                let low = bumps.clone();
                let start = Vector3::new(0.0, 0.3, 0.0);
                let mut wheel = placed(model.clone(), bumps, StepOptions::default(), start);
                let still = wheel.q().clone();
                let (x, z) = (5.0 * heading.cos(), 5.0 * heading.sin());
                wheel.set_state(still, vec![x, 0.0, z, 0.0, 0.0, 0.0]);
                for _ in 0..80 {
                    wheel.step(1).unwrap();
                    let x = wheel.q().position;
                    let ground = low.height(x.x, x.z).unwrap();
                    assert!(x.y > ground, "{width}, {spacing}: {x} under {ground}");
                }
            }
        }
    }
}
