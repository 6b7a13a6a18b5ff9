//! Coulomb's friction in De Saxcé's form: `K_μ* ∋ ũ ⊥ p ∈ K_μ` with `ũ = u + μ|u_T| n`.
//!
//! Together with Signorini's condition this says: open (`p = 0`, `u_N ≥ 0`), stick (`u = 0`,
//! `|p_T| ≤ μ p_N`), or slide (`u_N = 0`, `p_T = −μ p_N u_T/|u_T|`). The shift `μ|u_T| n` makes the
//! law nonassociated; without it a sliding contact would lift off with the velocity `μ|u_T|` (the
//! convex relaxation). Source: De Saxcé and Feng 1998; Acary and Brogliato 2008, ch. 3.

use super::associated;
use super::friction_law::FrictionLaw;
use super::mode::{ContactMode, Mode};
use super::one_contact::solve_one_contact;
use super::signorini;
use crate::cone::{project_on_disc, shortened, split, tangential_norm};
use crate::space::dot;

/// De Saxcé's modified velocity `ũ = u + μ|u_T| n`, m/s.
///
/// `u`: local velocity `[normal, tangent, (tangent)]`, m/s, restitution
/// already added to the normal.
#[inline]
#[must_use]
pub fn modified_velocity<const D: usize>(u: &[f64; D], friction_coefficient: f64) -> [f64; D] {
    let mut shifted = *u;
    shifted[0] += friction_coefficient * tangential_norm(u);
    shifted
}

/// Natural map of one contact, `p − Π_K(p − ρ ũ)`, N s: zero exactly where the law holds.
///
/// `p`: impulse, N s. `u`: velocity, m/s. `rho`: positive scale, kg. Divided by `rho` it is the
/// violation in m/s (by Moreau's split it equals `ρ (ũ − Π_K*(ũ − p/ρ))`).
#[inline]
#[must_use]
pub fn natural_map<const D: usize>(
    p: &[f64; D],
    u: &[f64; D],
    friction_coefficient: f64,
    rho: f64,
) -> [f64; D] {
    let shifted = modified_velocity(u, friction_coefficient);
    associated::natural_map(p, &shifted, friction_coefficient, rho)
}

/// Violation of Signorini's condition and of Coulomb's law by one contact,
/// each as a velocity (m/s); zero exactly where both hold.
///
/// ```text
/// normal      min(u_N, p_N/ρ_N)
/// tangential  (p_T − Π_D(p_T − ρ_T u_T))/ρ_T,   D the disc of radius μ max(p_N, 0)
/// ```
///
/// `p`: impulse, N s. `u`: velocity, m/s. `rho`: `[ρ_N, ρ_T]`, kg, about the inverse diagonal of
/// the contact's block of W. Unlike the [natural map](natural_map) it does not multiply a velocity
/// by μ, a product that swamps the digits of `u_N` when μ is large: in floating point `p = 0` at
/// `u = (−1, 1)` is a zero of the natural map from μ = 1e16 on, and nearly one from 1e8 on. Source:
/// Alart and Curnier 1991.
#[inline]
#[must_use]
pub fn violation<const D: usize>(
    p: &[f64; D],
    u: &[f64; D],
    friction_coefficient: f64,
    rho: [f64; 2],
) -> [f64; D] {
    Coulomb(friction_coefficient).violation(p, u, rho)
}

/// The law with its coefficient μ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coulomb(pub f64);

impl<const D: usize> FrictionLaw<D> for Coulomb {
    #[inline]
    fn project(&self, p_N: f64, z: &[f64; D]) -> [f64; D] {
        project_on_disc(z, self.0 * p_N)
    }

    #[inline]
    fn answer(&self, W: &[[f64; D]; D], q: &[f64; D]) -> [f64; D] {
        solve_one_contact(W, q, self.0).impulse
    }

    #[inline]
    fn linearise(&self, p: &[f64; D], u: &[f64; D], [rho_N, rho_T]: [f64; 2]) -> Mode<f64> {
        let mut z: [f64; D] = std::array::from_fn(|k| p[k] - rho_T * u[k]);
        z[0] = p[0] - rho_N * u[0];
        if z[0] <= 0.0 {
            return Mode::new(ContactMode::Open);
        }
        let norm = tangential_norm(&z);
        let radius = self.0 * z[0];
        if self.0 <= 0.0 {
            Mode::new(ContactMode::Slip)
        } else if norm <= radius {
            Mode::new(ContactMode::Stick)
        } else {
            // A contact about to open would have infinite turning stiffness.
            let gamma = ((norm - radius) / (rho_T * radius)).min(1e12 / rho_T);
            Mode::along(self.0, &z, norm, gamma)
        }
    }
}

impl Coulomb {
    /// Answer of a contact whose block of W is diagonal and the same along each tangent, along the
    /// world's axes: from the impulse `start`, N s, at the velocity `u`, m/s.
    ///
    /// `inverse`: `[1/W_NN, 1/W_TT]`, kg.
    #[allow(clippy::inline_always)] // a visit of a contact is one piece of code
    #[inline(always)]
    #[must_use]
    pub fn answer_of_round(
        self,
        n: &[f64; 3],
        inverse: [f64; 2],
        start: &[f64; 3],
        u: &[f64; 3],
    ) -> [f64; 3] {
        let normal = (dot(n, start) - inverse[0] * dot(n, u)).max(0.0);
        let wanted = std::array::from_fn(|k| start[k] - inverse[1] * u[k]);
        let (_, across) = split(n, &wanted);
        let across = shortened(across, self.0 * normal);
        std::array::from_fn(|k| n[k] * normal + across[k])
    }

    /// Square of the [`violation`] of such a contact, (m/s)².
    #[allow(clippy::inline_always)]
    #[inline(always)]
    #[must_use]
    pub fn violation_of_round(
        self,
        n: &[f64; 3],
        [rho_N, rho_T]: [f64; 2],
        p: &[f64; 3],
        u: &[f64; 3],
    ) -> f64 {
        let (u_n, u_t) = split(n, u);
        let (p_n, p_t) = split(n, p);
        let mut wanted = p_t;
        for k in 0..3 {
            wanted[k] -= rho_T * u_t[k];
        }
        let across = shortened(wanted, self.0 * p_n);
        let mut square = signorini::violation(u_n, p_n, rho_N).powi(2);
        for k in 0..3 {
            square += ((p_t[k] - across[k]) / rho_T).powi(2);
        }
        square
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length<const D: usize>(v: [f64; D]) -> f64 {
        v.iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    #[test]
    fn the_three_states_are_zeros_of_the_natural_map() {
        let mu = 0.5;
        assert!(
            length(natural_map(&[0.0; 3], &[0.2, 3.0, -4.0], mu, 0.7)) < 1e-15,
            "open, moving sideways"
        );
        assert!(
            length(natural_map(&[2.0, 0.3, 0.1], &[0.0; 3], mu, 0.7)) < 1e-15,
            "stick"
        );
        // Slides along (0.6, 0.8), so p_T = −μ p_N (0.6, 0.8).
        assert!(
            length(natural_map(&[2.0, -0.6, -0.8], &[0.0, 3.0, 4.0], mu, 0.7)) < 1e-15,
            "slide"
        );
    }

    #[test]
    fn the_three_states_violate_nothing_at_any_friction() {
        let scales = [0.7, 0.3];
        for mu in [1e-12, 0.5, 1e12] {
            for (p, u) in [
                ([0.0; 3], [0.2, 3.0, -4.0]),
                ([2.0, 0.6 * mu, 0.8 * mu], [0.0; 3]),
                ([2.0, -1.2 * mu, -1.6 * mu], [0.0, 3.0, 4.0]),
            ] {
                assert!(length(violation(&p, &u, mu, scales)) < 1e-14 * (1.0 + mu));
            }
        }
    }

    #[test]
    fn no_friction_hides_an_approach_or_a_slip() {
        for mu in [0.0, 1e-12, 1.0, 1e8, 1e12, 1e300] {
            let [normal, ..] = violation(&[0.0; 3], &[-1.0, 1.0, 1.0], mu, [1.0; 2]);
            assert!((normal - 1.0).abs() < 1e-15, "{mu}");
            let [_, slip] = violation(&[1.0, 0.0], &[0.0, 1e-3], mu, [1.0; 2]);
            assert!((slip - mu.min(1e-3)).abs() < 1e-15, "{mu}");
        }
    }

    #[test]
    fn the_relaxed_solution_of_a_sliding_contact_is_refused() {
        // Lifts off with μ|u_T|, as convex relaxations do.
        let violation = length(natural_map(&[2.0, -1.0], &[0.5 * 3.0, 3.0], 0.5, 1.0));
        assert!(violation > 0.1);
    }
}
