//! Violation of the law by the contacts side by side, which is measured by the projection of
//! `z = p − ρ u` (Alart and Curnier 1991).

use super::store::{Store, Triple};
use crate::problem::ContactScales;
use crate::scalar::Lane;

/// What a contact's law needs to know of its problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawParameters<T> {
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
pub(crate) struct LaneViolations<T> {
    /// `Σ |v_i|²`, (m/s)².
    pub squares: T,
    /// `Σ |ρ_i v_i|²`, (N s)².
    pub weighted: T,
    /// `max |v_i|²`, (m/s)².
    pub largest: T,
}

impl<T: Lane> LawParameters<T> {
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

/// Violations of the law at impulses `p` and velocities `u` of the contacts at some places.
#[inline(always)]
pub(super) fn judge<T: Lane, B: Store>(
    places: impl Iterator<Item = usize>,
    laws: &B::Of<LawParameters<T>>,
    p: &B::Of<Triple<T>>,
    u: &B::Of<Triple<T>>,
    zero: T,
) -> LaneViolations<T> {
    let one = zero.like(1.0);
    let mut sums = LaneViolations::none(zero);
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

impl<T: Lane> LaneViolations<T> {
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
