//! The Coulomb cone `K_μ = { p : |p_T| ≤ μ p_N }`, a second-order cone of half-angle `atan μ`.

use super::tangential_norm;

/// Coulomb's friction cone `K_μ = { p : |p_T| ≤ μ p_N }`.
///
/// `μ = 0` is the half-line of a frictionless contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondOrderCone {
    /// Friction coefficient `μ ≥ 0`, dimensionless.
    pub friction_coefficient: f64,
}

impl SecondOrderCone {
    /// The cone `K_μ`; `friction_coefficient` is `μ ≥ 0`.
    #[inline]
    #[must_use]
    pub const fn new(friction_coefficient: f64) -> Self {
        Self {
            friction_coefficient,
        }
    }

    /// Euclidean projection `Π_K(z)`.
    ///
    /// Three regions: points of the polar cone (`z_N ≤ −μ|z_T|`) map to the apex, points of the
    /// cone stay, and all others land on the generator in their meridian plane:
    /// `p_N = (z_N + μ|z_T|)/(1 + μ²)`, `p_T = μ p_N z_T/|z_T|`.
    #[inline]
    #[must_use]
    pub fn project<const D: usize>(self, z: &[f64; D]) -> [f64; D] {
        let mu = self.friction_coefficient;
        let norm = tangential_norm(z);
        if z[0] <= -mu * norm {
            return [0.0; D];
        }
        if norm <= mu * z[0] {
            return *z;
        }
        let p_N = (z[0] + mu * norm) / (1.0 + mu * mu);
        let scale = mu * p_N / norm;
        let mut p = *z;
        p[0] = p_N;
        for component in &mut p[1..] {
            *component *= scale;
        }
        p
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
        a.iter().zip(b).map(|(x, y)| x * y).sum()
    }

    #[test]
    fn one_case_for_each_region() {
        let cone = SecondOrderCone::new(0.5);
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-15);
        assert!(
            close(cone.project(&[2.0, 0.6, 0.8]), [2.0, 0.6, 0.8]),
            "inside"
        );
        assert!(close(cone.project(&[-2.0, 0.6, 0.8]), [0.0; 3]), "polar");
        // z = (0, 3, 4): p_N = 0.5·5/1.25 = 2, |p_T| = 1 along (0.6, 0.8).
        assert!(
            close(cone.project(&[0.0, 3.0, 4.0]), [2.0, 0.6, 0.8]),
            "between"
        );
    }

    #[test]
    fn frictionless_cone_is_the_half_line() {
        let cone = SecondOrderCone::new(0.0);
        assert_eq!(
            cone.project(&[-1.0, 0.0]).map(f64::to_bits),
            [0.0, 0.0].map(f64::to_bits)
        );
        assert_eq!(
            cone.project(&[3.0, -2.0]).map(f64::abs).map(f64::to_bits),
            [3.0, 0.0].map(f64::to_bits)
        );
        let projected = cone.project(&[1.0, 1e-3]);
        assert!(projected[1].abs() < 1e-15, "no tangential impulse");
    }

    /// Moreau's split: `z = Π_K(z) − Π_K*(−z)` with orthogonal parts; also inside and idempotent.
    fn check_moreau<const D: usize>(z: [f64; D], mu: f64) -> Result<(), TestCaseError> {
        let cone = SecondOrderCone::new(mu);
        let p = cone.project(&z);
        let d = cone.dual().project(&z.map(|x| -x));
        let scale = 1.0 + dot(&z, &z);
        let (p_T, d_T) = (tangential_norm(&p), tangential_norm(&d));
        prop_assert!(p_T - mu * p[0] <= 1e-13 * scale && p[0] >= -1e-13 * scale);
        prop_assert!(mu * d_T - d[0] <= 1e-13 * scale);
        prop_assert!(dot(&p, &d).abs() <= 1e-13 * scale);
        let again = cone.project(&p);
        for k in 0..D {
            prop_assert!((z[k] - (p[k] - d[k])).abs() <= 1e-13 * scale);
            prop_assert!((again[k] - p[k]).abs() <= 1e-13 * scale);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn moreau_split_in_space(z in prop::array::uniform3(-10.0..10.0f64), mu in 0.0..2.0f64) {
            check_moreau(z, mu)?;
        }

        #[test]
        fn moreau_split_in_the_plane(z in prop::array::uniform2(-10.0..10.0f64), mu in 0.0..2.0f64) {
            check_moreau(z, mu)?;
        }
    }
}
