//! Bodies that roll down a slope without sliding, against a = g sin α / (1 + I / (m r²)).

use super::collider_scenes::{GRAVITY, STEP, body, placed, take};
use crate::shared::{VARIANTS, near_in};

#[test]
fn a_cylinder_a_capsule_and_an_ellipsoid_roll_as_fast_as_their_inertia_lets_them() {
    // Along z, the axis across the slope.
    let turn = [std::f64::consts::FRAC_PI_2, 0.0, 0.0];
    let (r, h) = (0.1_f64, 0.4_f64);
    let balls = 4.0 * r / (4.0 * r + 3.0 * h);
    let cases = [
        ("kind = 'cylinder', radius = 0.1, height = 0.4", 0.5),
        (
            "kind = 'capsule', radius = 0.1, height = 0.4",
            0.4 * balls + 0.5 * (1.0 - balls),
        ),
        ("kind = 'ellipsoid', radii = [0.1, 0.3, 0.1]", 0.4),
    ];
    let slope = 0.2_f64;
    for variant in VARIANTS {
        for (shape, inertia) in cases {
            let mut simulation = placed(body(shape), [0.0, r, 0.0], turn, slope, variant);
            let steps = 200;
            take(&mut simulation, steps);
            let v = simulation.v();
            let time = STEP * steps as f64;
            let expected = GRAVITY * slope.sin() * time / (1.0 + inertia);
            near_in(&shape, v[0], expected, 1e-3 * expected);
            // It does not slide, and does not turn aside.
            assert!((v[0] + v[5] * r).abs() < 1e-6, "{shape}: {v:?}");
            assert!(
                v[2].abs() + v[3].abs() + v[4].abs() < 1e-6,
                "{shape}: {v:?}"
            );
        }
    }
}
