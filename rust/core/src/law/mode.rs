//! Open, stick or slip: the three states of a contact, and the law linearised in one of them.

use crate::cone::tangential_norm;

/// The three states of a contact with friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ContactMode {
    /// No impulse, `p = 0` and `u_N ≥ 0`.
    #[default]
    Open,
    /// No velocity, `u = 0` and `|p_T| ≤ μ p_N`.
    Stick,
    /// `u_N = 0` and `p_T = −μ p_N u_T/|u_T|`.
    Slip,
}

/// The law of one contact linearised in a mode: what Newton's method needs.
///
/// A slide keeps the direction e of the tangential impulse and the speed against it,
/// `u_T = −γ p_T`; the turning stiffness γ, 1/kg, is `|u_T|/|p_T|` at a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tangent {
    /// The mode.
    pub mode: ContactMode,
    /// Direction of the tangential impulse when sliding.
    pub e: [f64; 2],
    /// Turning stiffness γ of the sliding direction, 1/kg.
    pub gamma: f64,
}

/// Direction of the tangential part of `v`, of size `norm`; zero for a zero vector.
#[inline]
fn direction<const D: usize>(v: &[f64; D], norm: f64) -> [f64; 2] {
    if norm > 0.0 {
        [v[1] / norm, v[D - 1] / norm]
    } else {
        [0.0; 2]
    }
}

impl Tangent {
    /// A slide at impulse `p`, N s, and velocity `u`, m/s.
    #[inline]
    #[must_use]
    pub fn sliding<const D: usize>(p: &[f64; D], u: &[f64]) -> Self {
        let norm = tangential_norm(p);
        let along: f64 = p[1..].iter().zip(&u[1..]).map(|(p, u)| p * u).sum();
        Self {
            mode: ContactMode::Slip,
            e: direction(p, norm),
            gamma: if norm > 0.0 {
                (-along / (norm * norm)).max(0.0)
            } else {
                0.0
            },
        }
    }

    /// A slide whose tangential impulse is that of `z`, of size `norm`.
    #[inline]
    #[must_use]
    pub fn along<const D: usize>(z: &[f64; D], norm: f64, gamma: f64) -> Self {
        Self {
            mode: ContactMode::Slip,
            e: direction(z, norm),
            gamma,
        }
    }
}
