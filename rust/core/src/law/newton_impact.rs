//! Newton's impact law `u_N⁺ + e u_N⁻ ≥ 0`, folded into the free velocity
//! of the friction-contact problem.

/// `e u_N⁻`, m/s: added to the normal free velocity, it makes the problem's
/// `u_N` mean `u_N⁺ + e u_N⁻`.
///
/// `restitution`: `e` in `[0, 1]`. `u_N_before`: normal velocity before the impact, m/s, of either
/// sign. With a common e the kinetic energy changes by `(1 − e)/2 pᵀ u⁻` without friction, which
/// never is a gain; an e that looked at the sign of each `u_N⁻` would break this, and did: a
/// parting contact held to `u_N⁺ ≥ 0` while its neighbours bounced gave energy to the rover.
#[inline]
#[must_use]
pub fn rebound(restitution: f64, u_N_before: f64) -> f64 {
    restitution * u_N_before
}
