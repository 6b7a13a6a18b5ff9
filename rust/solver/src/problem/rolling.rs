//! Contacts that bear a moment besides their impulse.

use super::RoundPair;
use crate::law::rolling::RollingFriction;

/// Rolling and drilling friction of one contact of two round bodies, beside its [`RoundPair`].
///
/// With the lever ℓ of the pair it takes the rolling velocity `w = ℓ (ω_a − ω_b)` and the impulse
/// `s = M/ℓ` of [`crate::law::rolling`]. In factor coordinates
///
/// ```text
/// w = k_a s_a y_a − k_b s_b y_b + free,    k = ℓ/r
/// ```
///
/// with the entries of the spins y and `s = r/√J` of the pair. In the plane only the third
/// component, about the viewer's axis, is not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingContact {
    /// k of each body, 0 for what does not rotate.
    pub levers: [f64; 2],
    /// Rolling and drilling friction of the contact.
    pub law: RollingFriction,
    /// w without impulses, along the world's axes, m/s.
    pub free: [f64; 3],
    /// s, N s: where a solve starts, then its answer.
    pub impulse: [f64; 3],
}

impl RollingContact {
    /// W of w, the same along each axis, 1/kg.
    #[inline]
    #[must_use]
    pub fn mobility<const D: usize>(&self, pair: &RoundPair<D>) -> f64 {
        let [a, b] = [0, 1].map(|side| self.levers[side] * pair.angular[side]);
        a * a + b * b
    }
}
