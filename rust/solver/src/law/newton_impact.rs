//! Newton's impact law `u_N⁺ + e u_N⁻ ≥ 0`, folded into the free velocity
//! of the friction-contact problem, and which approaches are impacts.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::Lane;

/// Least distance (m) and speed (m/s) that are no rounding.
const ROUNDING: f64 = 1e-9;

/// Normal speed up to which no approach is an impact, m/s: gravity `g` (m/s²) explains it in two
/// steps of h (s), or it is rounding.
#[inline(always)]
#[must_use]
pub fn slow_approach<T: Lane>(g: T, h: T) -> T {
    (g.like(2.0) * g * h).max(g.like(ROUNDING))
}

/// Height within which a resting contact stays closed, m: gravity `g` (m/s²) moves a body as far
/// in a step of h (s), or it is rounding.
#[inline(always)]
#[must_use]
pub fn hovering_height<T: Lane>(g: T, h: T) -> T {
    (g.like(0.5) * g * h * h).max(g.like(ROUNDING))
}

/// `e u_N⁻`, m/s: added to the normal free velocity, it makes the problem's
/// `u_N` mean `u_N⁺ + e u_N⁻`.
///
/// `restitution`: `e` in `[0, 1]`. `u_N_before`: normal velocity before the impact, m/s, of either
/// sign. Without friction and with a common e the kinetic energy changes by `(1 − e)/2 pᵀ u⁻`,
/// which is never a gain. The shift therefore applies whatever the sign of `u_N⁻`: a separating
/// contact that is held to `u_N⁺ ≥ 0` while its neighbours bounce adds energy.
#[inline(always)]
#[must_use]
pub fn rebound<T: Lane>(restitution: T, u_N_before: T) -> T {
    restitution * u_N_before
}

/// A pair at a gap: `e u_N⁻` if it collides within the step of h, s; any other may close by its
/// gap.
///
/// With `e u_N⁻ + s` and any s ≥ 0 a frictionless impact gains no energy; here s is what the gap
/// allows. `gap`: at the start of the step, m. `slow`: speed of an approach that is no impact, m/s.
#[must_use]
pub fn rebound_at_gap(restitution: f64, u_N_before: f64, gap: f64, (h, slow): (f64, f64)) -> f64 {
    let gap = gap.max(0.0);
    let rebound = rebound(restitution, u_N_before);
    if rebound < 0.0 && u_N_before < -slow && gap + h * u_N_before <= 0.0 {
        rebound
    } else {
        gap / h + rebound.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_bounces_only_where_it_meets_fast_and_within_the_step() {
        let step = (1e-3, 0.02);
        let is = |shift: f64, expected: f64, what: &str| {
            assert!((shift - expected).abs() < 1e-15, "{what}: {shift}");
        };
        is(rebound_at_gap(0.5, -1.0, 5e-4, step), -0.5, "an impact");
        is(rebound_at_gap(0.5, -1.0, 2e-3, step), 2.0, "too far");
        is(rebound_at_gap(0.5, -0.01, 0.0, step), 0.0, "too slow");
        is(rebound_at_gap(0.5, 1.0, 0.0, step), 0.5, "parts");
        is(rebound_at_gap(0.0, -1.0, -1e-4, step), 0.0, "overlaps");
    }
}
