//! Coulomb's friction in De Saxcé's form: `K_μ* ∋ ũ ⊥ p ∈ K_μ` with `ũ = u + μ|u_T| n`.
//!
//! Together with Signorini's condition this says: open (`p = 0`, `u_N ≥ 0`), stick (`u = 0`, `|p_T| ≤ μ p_N`), or
//! slide (`u_N = 0`, `p_T = −μ p_N u_T/|u_T|`). The shift `μ|u_T| n` makes the law nonassociated; without it a sliding
//! contact would lift off with the velocity `μ|u_T|` (the convex relaxation). Source: De Saxcé and Feng 1998; Acary and
//! Brogliato 2008, ch. 3.

use crate::cone::{SecondOrderCone, tangential_norm};

/// The three states of a contact with friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ContactMode {
    /// No impulse, `p = 0` and `u_N ≥ 0`.
    #[default]
    Open,
    /// No velocity, `u = 0` and `|p_T| ≤ μ p_N`.
    Stick,
    /// `u_N = 0` and `p_T = −μ p_N u_T/|u_T|`.
    Slide,
}

/// De Saxcé's modified velocity `ũ = u + μ|u_T| n`, m/s.
///
/// `u`: local velocity `[normal, tangent, (tangent)]`, m/s, restitution already added to the normal.
#[inline]
#[must_use]
pub fn modified_velocity<const D: usize>(u: &[f64; D], friction_coefficient: f64) -> [f64; D] {
    let mut shifted = *u;
    shifted[0] += friction_coefficient * tangential_norm(u);
    shifted
}

/// Natural map of one contact, `p − Π_K(p − ρ ũ)`, N s: zero exactly where the law holds.
///
/// `p`: impulse, N s. `u`: velocity, m/s. `rho`: positive scale, kg. Divided by `rho` it is the violation in m/s
/// (by Moreau's split it equals `ρ (ũ − Π_K*(ũ − p/ρ))`).
#[inline]
#[must_use]
pub fn natural_map<const D: usize>(
    p: &[f64; D],
    u: &[f64; D],
    friction_coefficient: f64,
    rho: f64,
) -> [f64; D] {
    let shifted = modified_velocity(u, friction_coefficient);
    let mut z = *p;
    for k in 0..D {
        z[k] -= rho * shifted[k];
    }
    let projected = SecondOrderCone::new(friction_coefficient).project(&z);
    let mut map = *p;
    for k in 0..D {
        map[k] -= projected[k];
    }
    map
}

/// The mode that the pair `(p, u)` of a solved contact shows.
///
/// `threshold`: impulses below it count as none, N s. Sliding is reported when the impulse reaches the cone's surface
/// up to `threshold`, which includes the limit case of a contact about to slide.
#[must_use]
pub fn observed_mode<const D: usize>(
    p: &[f64; D],
    friction_coefficient: f64,
    threshold: f64,
) -> ContactMode {
    if p[0] <= threshold {
        ContactMode::Open
    } else if tangential_norm(p) < friction_coefficient * p[0] - threshold {
        ContactMode::Stick
    } else {
        ContactMode::Slide
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
    fn the_relaxed_solution_of_a_sliding_contact_is_refused() {
        // Lifts off with μ|u_T|, as convex relaxations do.
        let violation = length(natural_map(&[2.0, -1.0], &[0.5 * 3.0, 3.0], 0.5, 1.0));
        assert!(violation > 0.1);
    }

    #[test]
    fn modes_are_read_from_the_impulse() {
        assert_eq!(
            observed_mode(&[0.0, 0.0, 0.0], 0.5, 1e-12),
            ContactMode::Open
        );
        assert_eq!(
            observed_mode(&[1.0, 0.1, 0.2], 0.5, 1e-12),
            ContactMode::Stick
        );
        assert_eq!(
            observed_mode(&[1.0, 0.3, 0.4], 0.5, 1e-12),
            ContactMode::Slide
        );
    }
}
