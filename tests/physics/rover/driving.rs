//! The independent check: a drive on flat ground on which three other engines agree at a fine step.
//!
//! Wheel radius 0.20, μ 0.7, e 0, gains 15000 on all steering joints, mass centre of each
//! steering solid 7.5 cm low; dropped from 5 cm, 2 s of rest, then 10 s with front
//! steering set-points −0.1 rad and 20 N m a wheel: displacement 12.585 m along and
//! 18.770 m across the start heading, heading change 1.896 rad.

use rover_core::integrator::Variant;

use super::scenes::{VARIANTS, check_drive};

/// Distance (m) and heading error (rad) from where the three engines end.
fn errors(variant: Variant, h: f64) -> (f64, f64) {
    let (moved, heading, report) = check_drive(variant, h);
    assert!(report.is_converged(), "{variant:?} at {h} s: {report:?}");
    (
        (moved.x - 12.585).hypot(moved.z - 18.770),
        (heading.abs() - 1.896).abs(),
    )
}

#[test]
fn agrees_with_three_engines() {
    for variant in VARIANTS {
        for (h, bound) in [(0.02, 0.015), (0.005, 0.005), (0.001, 0.002)] {
            let (distance, heading) = errors(variant, h);
            assert!(distance < bound, "{variant:?} at {h} s: {distance} m");
            assert!(heading < 1e-3, "{variant:?} at {h} s: {heading} rad");
        }
    }
}
