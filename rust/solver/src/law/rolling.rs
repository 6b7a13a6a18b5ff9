//! Rolling and drilling friction: moments between two round bodies that resist their relative
//! rotation.
//!
//! The relative angular velocity `Ω = ω_a − ω_b` has a part Ω_R across the normal, with which the
//! bodies roll on each other, and a part Ω_n along it, with which one drills into the other. Each
//! part has a moment of its own, bounded by the normal impulse:
//!
//! ```text
//! |M_R| ≤ μ_r ℓ p_N,  M_R = −μ_r ℓ p_N Ω_R/|Ω_R|  where Ω_R ≠ 0
//! |M_n| ≤ μ_d ℓ p_N,  M_n = −μ_d ℓ p_N sign(Ω_n)  where Ω_n ≠ 0
//! ```
//!
//! As in Coulomb's law a moment below its bound holds, `Ω = 0`, so a ball rests on a slope of up to
//! `tan α = μ_r`. The lever ℓ is the rolling radius of the pair, `1/ℓ = 1/r_a + 1/r_b`, and the
//! ball's own radius on a wall. Both coefficients are therefore numbers without unit, the same for
//! grains of all sizes.
//!
//! Velocities and impulses are in the units of a contact's: `w = ℓ Ω` in m/s and `s = M/ℓ` in N s,
//! `|s_R| ≤ μ_r p_N`. Each bound is a section of a cone, and the law is the projection on it:
//! `s = Π(s − ρ w)` for any ρ > 0. In the plane bodies only roll, about the viewer's axis.
//!
//! Source: Acary and Bourrier 2021 (the law as a cone complementarity problem); Ai et al. 2011 (the
//! rolling radius).

use crate::cone::{shortened, split};
use crate::quantity::{QuantityError, not_negative};
use crate::space::dot;

/// Coefficients of rolling and drilling friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RollingFriction {
    /// μ_r, dimensionless: lever arm of the normal force over the rolling radius.
    pub rolling: f64,
    /// μ_d, dimensionless: moment about the normal over normal force and rolling radius.
    pub drilling: f64,
}

impl RollingFriction {
    /// # Errors
    /// A coefficient that is not finite or negative.
    pub fn check(&self) -> Result<(), QuantityError> {
        for (field, value) in [
            ("rolling_friction", self.rolling),
            ("drilling_friction", self.drilling),
        ] {
            not_negative(field, value)?;
        }
        Ok(())
    }

    /// Whether no contact bears a moment.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.rolling == 0.0 && self.drilling == 0.0
    }

    /// Nearest admissible impulse to `z`, N s, at the normal n and the normal impulse `p_N`.
    #[inline]
    #[must_use]
    pub fn project(&self, n: &[f64; 3], p_N: f64, z: &[f64; 3]) -> [f64; 3] {
        let p_N = p_N.max(0.0);
        let (along, across) = split(n, z);
        let across = shortened(across, self.rolling * p_N);
        let limit = self.drilling * p_N;
        let along = along.min(limit).max(-limit);
        std::array::from_fn(|k| across[k] + n[k] * along)
    }

    /// Nearest admissible impulse to `z`, N s, in the plane, at the normal impulse `p_N`.
    #[inline]
    #[must_use]
    pub fn project_in_plane(&self, p_N: f64, z: f64) -> f64 {
        let limit = self.rolling * p_N.max(0.0);
        z.min(limit).max(-limit)
    }

    /// Square of the violation of the law, (m/s)², by the impulse s, N s, at the velocity w, m/s;
    /// `rho` as in [`crate::law::coulomb::violation`], kg.
    #[inline]
    #[must_use]
    pub fn violation(
        &self,
        (n, p_N): (&[f64; 3], f64),
        s: &[f64; 3],
        w: &[f64; 3],
        rho: f64,
    ) -> f64 {
        let wanted = std::array::from_fn(|k| s[k] - rho * w[k]);
        let projected = self.project(n, p_N, &wanted);
        let off: [f64; 3] = std::array::from_fn(|k| (s[k] - projected[k]) / rho);
        dot(&off, &off)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAW: RollingFriction = RollingFriction {
        rolling: 0.2,
        drilling: 0.05,
    };

    #[test]
    fn rest_rolling_and_drilling_obey_the_law_and_nothing_else_does() {
        let n = [0.0, 1.0, 0.0];
        let violation = |s: [f64; 3], w: [f64; 3]| LAW.violation((&n, 2.0), &s, &w, 0.7).sqrt();
        // p_N = 2: |s_R| ≤ 0.4, |s_n| ≤ 0.1.
        assert!(violation([0.1, 0.05, -0.3], [0.0; 3]) < 1e-15, "holds");
        assert!(
            violation([-0.24, 0.0, -0.32], [3.0, 0.0, 4.0]) < 1e-15,
            "rolls"
        );
        assert!(
            violation([0.0, -0.1, 0.0], [0.0, 5.0, 0.0]) < 1e-15,
            "drills"
        );
        assert!(violation([0.0; 3], [3.0, 0.0, 4.0]) > 0.5, "rolls freely");
        assert!(
            violation([0.24, 0.0, 0.32], [3.0, 0.0, 4.0]) > 1.0,
            "pushes"
        );
        assert!(violation([0.5, 0.0, 0.0], [0.0; 3]) > 0.1, "too much");
    }

    proptest! {
        #[test]
        fn a_projection_is_admissible_and_the_nearest(
            z in prop::array::uniform3(-2.0..2.0f64),
            other in prop::array::uniform3(-2.0..2.0f64),
            axis in prop::array::uniform3(-1.0..1.0f64),
            p_N in -0.5..3.0f64,
        ) {
            let size = dot(&axis, &axis).sqrt();
            prop_assume!(size > 0.1);
            let n = axis.map(|x| x / size);
            let s = LAW.project(&n, p_N, &z);
            let (along, across) = split(&n, &s);
            let p_N = p_N.max(0.0);
            prop_assert!(dot(&across, &across).sqrt() <= LAW.rolling * p_N + 1e-14);
            prop_assert!(along.abs() <= LAW.drilling * p_N + 1e-14);
            let again = LAW.project(&n, p_N, &s);
            prop_assert!((0..3).all(|k| (again[k] - s[k]).abs() < 1e-14));
            // Of a convex set: (z − Π z)ᵀ (x − Π z) ≤ 0 for each x in it.
            let x = LAW.project(&n, p_N, &other);
            let product: f64 = (0..3).map(|k| (z[k] - s[k]) * (x[k] - s[k])).sum();
            prop_assert!(product <= 1e-14);
        }
    }
}
