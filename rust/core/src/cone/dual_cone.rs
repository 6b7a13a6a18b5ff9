//! The dual of Coulomb's cone, `K_μ* = { u : u_N ≥ μ |u_T| }`, where the modified velocity `ũ` lives.

use super::{SecondOrderCone, tangential_norm};

/// Dual cone `K_μ* = { u : u·p ≥ 0 for all p in K_μ } = { u_N ≥ μ |u_T| }`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualCone {
    /// Friction coefficient `μ ≥ 0` of the primal cone, dimensionless.
    pub friction_coefficient: f64,
}

impl DualCone {
    /// The dual of `K_μ`; `friction_coefficient` is `μ ≥ 0`.
    #[inline]
    #[must_use]
    pub const fn new(friction_coefficient: f64) -> Self {
        Self {
            friction_coefficient,
        }
    }

    /// How far `u` leaves the cone: `max(0, μ|u_T| − u_N)`, in the unit of `u`.
    #[inline]
    #[must_use]
    pub fn violation<const D: usize>(self, u: &[f64; D]) -> f64 {
        (self.friction_coefficient * tangential_norm(u) - u[0]).max(0.0)
    }

    /// Whether `u` lies in the cone, up to `tolerance` in the unit of `u`.
    #[inline]
    #[must_use]
    pub fn contains<const D: usize>(self, u: &[f64; D], tolerance: f64) -> bool {
        self.violation(u) <= tolerance
    }

    /// Euclidean projection by Moreau's identity, `Π_K*(z) = z + Π_K(−z)`.
    #[inline]
    #[must_use]
    pub fn project<const D: usize>(self, z: &[f64; D]) -> [f64; D] {
        let primal = SecondOrderCone::new(self.friction_coefficient).project(&z.map(|x| -x));
        let mut out = *z;
        for k in 0..D {
            out[k] += primal[k];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frictionless_dual_is_the_half_space() {
        let dual = DualCone::new(0.0);
        assert!(dual.contains(&[0.0, 5.0, -7.0], 0.0));
        let u = dual.project(&[-2.0, 5.0, -7.0]);
        assert!((u[0]).abs() < 1e-15 && (u[1] - 5.0).abs() < 1e-15 && (u[2] + 7.0).abs() < 1e-15);
    }
}
