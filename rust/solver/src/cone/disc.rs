//! Projection on the friction disc `D(r) = { |v_T| ≤ r }`, the section of
//! the Coulomb cone at one normal impulse.

use super::tangential_norm;
use crate::space::dot;

/// Nearest point of the disc `|v_T| ≤ radius` to the tangential part of
/// `v`; the normal component passes through.
///
/// `v`: `[normal, tangent, (tangent)]`. A negative radius counts as zero.
#[inline]
#[must_use]
pub fn project_on_disc<const D: usize>(v: &[f64; D], radius: f64) -> [f64; D] {
    let radius = radius.max(0.0);
    let norm = tangential_norm(v);
    let mut out = *v;
    if norm > radius {
        let scale = radius / norm;
        for component in &mut out[1..] {
            *component *= scale;
        }
    }
    out
}

/// Projects the tangential part of an impulse onto the friction disc of a nonnegative radius.
#[inline]
pub fn draw_in<const D: usize>(p: &mut [f64; D], limit: f64) {
    if D == 2 {
        p[1] = p[1].min(limit).max(-limit);
        return;
    }
    let square = p[1] * p[1] + p[2] * p[2];
    if square > limit * limit {
        let share = limit / square.sqrt();
        p[1] *= share;
        p[2] *= share;
    }
}

/// Shortens a vector of the world to a nonnegative `limit`.
#[allow(clippy::inline_always)] // a visit of a contact is one piece of code
#[inline(always)]
#[must_use]
pub fn shortened(t: [f64; 3], limit: f64) -> [f64; 3] {
    let square = dot(&t, &t);
    let share = if square > limit * limit {
        limit / square.sqrt()
    } else {
        1.0
    };
    [share * t[0], share * t[1], share * t[2]]
}

/// Parts of a vector of the world along and across a unit normal.
#[allow(clippy::inline_always)]
#[inline(always)]
#[must_use]
pub fn split(n: &[f64; 3], x: &[f64; 3]) -> (f64, [f64; 3]) {
    let along = dot(n, x);
    let mut across = *x;
    for k in 0..3 {
        across[k] -= n[k] * along;
    }
    (along, across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_negative_radius_is_a_point() {
        let projected = project_on_disc(&[7.0, 3.0, 4.0], -1.0);
        assert_eq!(
            projected.map(f64::to_bits),
            [7.0, 0.0, 0.0].map(f64::to_bits)
        );
    }

    proptest! {
        #[test]
        fn lands_inside_is_idempotent_and_radial(
            v in prop::array::uniform3(-10.0..10.0f64),
            radius in 0.0..5.0f64,
        ) {
            let once = project_on_disc(&v, radius);
            let twice = project_on_disc(&once, radius);
            prop_assert!(tangential_norm(&once) <= radius * (1.0 + 1e-15));
            // Radial: the cross product of input and output vanishes.
            prop_assert!((v[1] * once[2] - v[2] * once[1]).abs() <= 1e-13);
            for k in 0..3 {
                prop_assert!((once[k] - twice[k]).abs() <= 1e-14);
            }
        }
    }
}
