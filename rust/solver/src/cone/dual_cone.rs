//! The dual of Coulomb's cone, `K_μ* = { u : u_N ≥ μ |u_T| }`, where the
//! modified velocity `ũ` lives.

use super::SecondOrderCone;

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

impl SecondOrderCone {
    /// The dual cone `K_μ* = { u : u_N ≥ μ |u_T| }`.
    #[inline]
    #[must_use]
    pub const fn dual(self) -> DualCone {
        DualCone::new(self.friction_coefficient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frictionless_dual_is_the_half_space() {
        let dual = DualCone::new(0.0);
        let inside = [0.0, 5.0, -7.0];
        assert_eq!(
            dual.project(&inside).map(f64::to_bits),
            inside.map(f64::to_bits)
        );
        let u = dual.project(&[-2.0, 5.0, -7.0]);
        assert!((u[0]).abs() < 1e-15 && (u[1] - 5.0).abs() < 1e-15 && (u[2] + 7.0).abs() < 1e-15);
    }
}
