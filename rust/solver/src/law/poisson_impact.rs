//! Poisson's impact law: the impulse of an impact's expansion is e times that of its compression.
//!
//! The compression is an impact without restitution, with the impulse p^c and the velocity u^c at
//! its end. In the expansion
//!
//! ```text
//! 0 ≤ u_N⁺  ⊥  p_N − e p_N^c ≥ 0,    |p_T| ≤ μ p_N,    u⁺ = W p + u^c,
//! ```
//!
//! so each contact gives back at least e times what it took. Without friction, and where no contact
//! is lost in the compression, this is Newton's law `u_N⁺ = −e u_N⁻`. With friction Newton's law
//! refers to velocities and may gain energy; Poisson's refers to impulses and does not, if e is the
//! same for all contacts. Source: Glocker and Pfeiffer 1995.

use super::coulomb::Coulomb;
use super::friction_law::FrictionLaw;

/// Coulomb's law of a contact in expansion, for the impulse beyond `least` along the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// Friction of the contact.
    pub friction: Coulomb,
    /// `e p_N^c`, N s.
    pub least: f64,
}

impl<const D: usize> FrictionLaw<D> for Expansion {
    fn project(&self, p_N: f64, z: &[f64; D]) -> [f64; D] {
        self.friction.project(p_N.max(0.0) + self.least, z)
    }

    fn answer(&self, W: &[[f64; D]; D], q: &[f64; D]) -> [f64; D] {
        // The contact answers as Coulomb's where its whole impulse exceeds the least.
        let mut before = *q;
        for k in 0..D {
            before[k] -= W[k][0] * self.least;
        }
        let mut p = self.friction.answer(W, &before);
        p[0] -= self.least;
        if p[0] < 0.0 {
            p = Loaded(*self).answer(W, q);
        }
        p
    }
}

/// [`Expansion`] with the answer that follows from its projection.
struct Loaded(Expansion);

impl<const D: usize> FrictionLaw<D> for Loaded {
    fn project(&self, p_N: f64, z: &[f64; D]) -> [f64; D] {
        self.0.project(p_N, z)
    }
}
