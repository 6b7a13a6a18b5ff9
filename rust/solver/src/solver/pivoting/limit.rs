//! The way of an impulse to the limit of friction, and back to it.

use super::store::Triple;
use crate::scalar::{Lane, LaneMask};

/// `x_T y_T − μ² x_N y_N`; for x = y positive outside the cone of friction.
#[inline(always)]
fn outside<T: Lane>(mu: T, x: &Triple<T>, y: &Triple<T>) -> T {
    x[1] * y[1] + x[2] * y[2] - mu * mu * (x[0] * y[0])
}

/// Smallest fraction of the step from `p` to `trial` at which a sticking contact reaches the limit
/// of friction, or a sliding one opens; 1 where neither does. `closed`, `sticks`: its mode.
#[inline(always)]
pub(super) fn limit<T: Lane>(
    (closed, sticks): (T::Mask, T::Mask),
    mu: T,
    p: &Triple<T>,
    trial: &Triple<T>,
) -> T {
    let (zero, one) = (mu.like(0.0), mu.like(1.0));
    let sticks = closed & sticks;
    let pressed = zero.lt(p[0]);
    let stays = outside(mu, trial, trial).le(zero) & zero.lt(trial[0]);
    let leaves = sticks & pressed & !stays;
    let opens = closed & !sticks & pressed & trial[0].lt(zero);
    let mut t = one;
    if leaves.any() {
        t = T::select(leaves, way_to_the_limit(mu, p, trial), t);
    }
    if opens.any() {
        t = T::select(opens, p[0] / (p[0] - trial[0]), t);
    }
    t
}

/// Fraction of the way from `p` to `trial` at which an impulse reaches the limit of friction.
#[inline(always)]
fn way_to_the_limit<T: Lane>(mu: T, p: &Triple<T>, trial: &Triple<T>) -> T {
    let (zero, one) = (mu.like(0.0), mu.like(1.0));
    let d = [trial[0] - p[0], trial[1] - p[1], trial[2] - p[2]];
    // |p_T + t d_T|² = μ² (p_N + t d_N)²
    let a = outside(mu, &d, &d);
    let b = outside(mu, p, &d);
    let c = outside(mu, p, p);
    let root = (b * b - a * c).max(zero).sqrt();
    // In the form without cancellation.
    let ahead = zero.le(b);
    let first = T::select(ahead, -c / (b + root), (root - b) / a);
    let second = T::select(ahead, (-b - root) / a, -c / (b + root));
    let first = T::select(zero.le(first), first, one);
    let second = T::select(zero.le(second), second, one);
    let inside = first.min(second).min(one);
    T::select(zero.le(c), T::select(ahead, zero, one), inside)
}

/// Scales the tangential impulse to `μ p_N` in the lanes of a mask.
#[inline(always)]
pub(super) fn return_to_cone<T: Lane>(lanes: T::Mask, mu: T, p: &mut Triple<T>) {
    if !lanes.any() {
        return;
    }
    let zero = mu.like(0.0);
    let norm = (p[1] * p[1] + p[2] * p[2]).sqrt();
    let scale = T::select(zero.lt(norm), mu * p[0].max(zero) / norm, zero);
    for p in &mut p[1..] {
        *p = T::select(lanes, *p * scale, *p);
    }
}
