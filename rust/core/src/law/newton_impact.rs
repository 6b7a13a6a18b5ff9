//! Newton's impact law `u_N⁺ + e u_N⁻ ≥ 0`, folded into the free velocity
//! of the friction-contact problem.

/// `e u_N⁻`, m/s: added to the normal free velocity, it makes the problem's
/// `u_N` mean `u_N⁺ + e u_N⁻`.
///
/// `restitution`: `e` in `[0, 1]`. `u_N_before`: normal velocity before the impact, m/s, of either
/// sign. Without friction and with a common e the kinetic energy changes by `(1 − e)/2 pᵀ u⁻`,
/// which is never a gain. The shift therefore applies whatever the sign of `u_N⁻`: a separating
/// contact that is held to `u_N⁺ ≥ 0` while its neighbours bounce adds energy.
#[inline]
#[must_use]
pub fn rebound(restitution: f64, u_N_before: f64) -> f64 {
    restitution * u_N_before
}
