//! Modes of the contacts side by side, and their violation of the law, which is measured by the
//! projection of `z = p − ρ u` (Alart and Curnier 1991).

use super::store::Store;
use crate::law::coulomb::AT_THE_LIMIT;
use crate::problem::ContactScales;
use crate::scalar::{Lane, LaneMask};

/// Entries of a contact along n, t, b.
pub(crate) type Triple<T> = [T; 3];

/// The linearised equations of one contact.
///
/// Its impulse is `p = C y` and its equations are the rows `Bᵀ` of `u + γ y = 0`:
///
/// ```text
///          C                      B                  γ
/// open     -                      0 0 0              1 1 1
/// stick    1 0 0                  1 0 0              0 0 0
///          0 1 0                  0 1 0
///          0 0 1                  0 0 1
/// slide    1    0    -            1 0    0           0 γ 1
///          μ e1 −e2  -            0 −e2  0
///          μ e2 e1   -            0 e1   0
/// ```
///
/// A column marked `-` may be anything, since its unknown is zero. In the plane the entries of
/// tangent t2 are zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mode<T: Lane> {
    /// `μ e`, zero unless sliding.
    pub a: [T; 2],
    /// `(−e2, e1)`; (1, 0) if sticking, zero if open or without friction.
    pub b: [T; 2],
    /// Lanes where the contact is closed.
    pub closed: T::Mask,
    /// Lanes where the contact sticks.
    pub stick: T::Mask,
    /// Turning stiffness of the second equation, 1/kg; 1 where `b` is zero.
    pub gamma: T,
}

/// What a contact's law needs to know of its problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law<T> {
    /// Friction coefficient.
    pub mu: T,
    /// `ρ_N` and `ρ_T`, kg.
    pub rho: [T; 2],
    /// `1/ρ_N` and `1/ρ_T`, 1/kg.
    pub inverse: [T; 2],
    /// Square of the contact's mass, kg².
    pub mass_squared: T,
}

/// Sums over the contacts' violations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Violations<T> {
    /// `Σ |v_i|²`, (m/s)².
    pub squares: T,
    /// `Σ |ρ_i v_i|²`, (N s)².
    pub weighted: T,
    /// `max |v_i|²`, (m/s)².
    pub largest: T,
}

impl<T: Lane> Law<T> {
    /// Sets the law of a lane's contact.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, mu: f64, scales: ContactScales) {
        let [rho_N, rho_T] = scales.modes;
        self.mu.set(lane, mu);
        self.rho[0].set(lane, rho_N);
        self.rho[1].set(lane, rho_T);
        self.inverse[0].set(lane, 1.0 / rho_N);
        self.inverse[1].set(lane, 1.0 / rho_T);
        self.mass_squared.set(lane, scales.mass * scales.mass);
    }

    /// Law of a contact without data: no friction, unit scales.
    #[inline(always)]
    pub(crate) fn new(zero: T) -> Self {
        let one = zero.like(1.0);
        Self {
            mu: zero,
            rho: [one; 2],
            inverse: [one; 2],
            mass_squared: one,
        }
    }
}

impl<T: Lane> Mode<T> {
    /// Open.
    #[inline(always)]
    pub(crate) fn open(like: T) -> Self {
        let (zero, one) = (like.like(0.0), like.like(1.0));
        Self {
            a: [zero; 2],
            b: [zero; 2],
            closed: one.lt(zero),
            stick: one.lt(zero),
            gamma: one,
        }
    }

    /// Open, sticking or sliding along the present impulse `p` with the velocity `u`.
    #[inline(always)]
    pub(crate) fn of(
        mu: T,
        closed: T::Mask,
        sticks: T::Mask,
        p: &Triple<T>,
        u: &Triple<T>,
    ) -> Self {
        let (zero, one) = (mu.like(0.0), mu.like(1.0));
        let (e, gamma, norm) = slide_along(p, u);
        let slides = closed & !sticks & zero.lt(mu) & zero.lt(norm);
        let sticks = closed & sticks;
        let e = [T::select(slides, e[0], zero), T::select(slides, e[1], zero)];
        Self {
            a: [mu * e[0], mu * e[1]],
            b: [T::select(sticks, one, -e[1]), e[0]],
            closed,
            stick: sticks,
            gamma: T::select(slides, gamma, T::select(sticks, zero, one)),
        }
    }

    /// `Bᵀ x` of a contact.
    #[inline(always)]
    pub(crate) fn across(&self, x: Triple<T>) -> Triple<T> {
        let zero = x[0].like(0.0);
        [
            T::select(self.closed, x[0], zero),
            self.b[0] * x[1] + self.b[1] * x[2],
            T::select(self.stick, x[2], zero),
        ]
    }

    /// `C y` of a contact.
    #[inline(always)]
    pub(crate) fn impulse(&self, [y0, y1, y2]: Triple<T>) -> Triple<T> {
        let Self { a, b, .. } = self;
        [y0, a[0] * y0 + b[0] * y1, a[1] * y0 + b[1] * y1 + y2]
    }
}

/// Whether the contact is closed and its impulse at the limit of friction or beyond.
#[inline(always)]
pub(super) fn is_pressed_to_slide<T: Lane>(mu: T, p: &Triple<T>) -> T::Mask {
    let zero = mu.like(0.0);
    let norm = (p[1] * p[1] + p[2] * p[2]).sqrt();
    let below = zero.lt(mu) & norm.lt(mu * p[0] * zero.like(1.0 - AT_THE_LIMIT));
    zero.lt(p[0]) & !below
}

/// Direction of the tangential impulse, the turning stiffness of a slide along it, and its size.
#[inline(always)]
fn slide_along<T: Lane>(p: &Triple<T>, u: &Triple<T>) -> ([T; 2], T, T) {
    let zero = p[0].like(0.0);
    let square = p[1] * p[1] + p[2] * p[2];
    let norm = square.sqrt();
    let inverse = zero.like(1.0) / norm;
    let along = p[1] * u[1] + p[2] * u[2];
    let gamma = (-(along * inverse) * inverse).max(zero);
    ([p[1] * inverse, p[2] * inverse], gamma, norm)
}

/// Violations of the law at impulses `p` and velocities `u` of the contacts at some places.
#[inline(always)]
pub(super) fn judge<T: Lane, B: Store>(
    places: impl Iterator<Item = usize>,
    laws: &B::Of<Law<T>>,
    p: &B::Of<Triple<T>>,
    u: &B::Of<Triple<T>>,
    zero: T,
) -> Violations<T> {
    let one = zero.like(1.0);
    let mut sums = Violations::none(zero);
    for i in places {
        let (law, p, u) = (&laws[i], &p[i], &u[i]);
        // The normal part: min(u_N, p_N/ρ_N).
        let pressed = p[0] * law.inverse[0];
        let normal = T::select(pressed.le(u[0]), pressed, u[0]);
        // The tangential part: (p_T − Π(z_T))/ρ_T with the disc of radius μ p_N.
        let rho_T = law.rho[1];
        let z = [p[1] - rho_T * u[1], p[2] - rho_T * u[2]];
        let norm = (z[0] * z[0] + z[1] * z[1]).sqrt();
        let radius = (law.mu * p[0]).max(zero);
        let scale = T::select(radius.lt(norm), radius / norm, one);
        let slip = [
            (p[1] - z[0] * scale) * law.inverse[1],
            (p[2] - z[1] * scale) * law.inverse[1],
        ];
        let square = normal * normal + (slip[0] * slip[0] + slip[1] * slip[1]);
        sums.squares += square;
        sums.weighted += law.mass_squared * square;
        sums.largest = square.max(sums.largest);
    }
    sums
}

impl<T: Lane> Violations<T> {
    /// No violation.
    #[inline(always)]
    pub(crate) fn none(like: T) -> Self {
        let zero = like.like(0.0);
        Self {
            squares: zero,
            weighted: zero,
            largest: zero,
        }
    }

    /// `yes` where the mask is true, `no` elsewhere.
    #[inline(always)]
    pub(crate) fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        Self {
            squares: T::select(mask, yes.squares, no.squares),
            weighted: T::select(mask, yes.weighted, no.weighted),
            largest: T::select(mask, yes.largest, no.largest),
        }
    }

    /// Whether the sums are finite, and with them all impulses and velocities.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> T::Mask {
        self.squares.is_finite() & self.weighted.is_finite()
    }
}

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
