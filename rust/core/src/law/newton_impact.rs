//! Newton's impact law `u_N⁺ + e u_N⁻ ≥ 0`, folded into the free velocity of the friction-contact problem.

/// `e u_N⁻` of an approaching contact, m/s, else 0: added to the normal free velocity, it makes the problem's `u_N` mean `u_N⁺ + e u_N⁻`.
///
/// `restitution`: `e` in `[0, 1]`. `u_N_before`: normal velocity before the impact, m/s; a contact that already parts does not
/// bounce, and may not be driven into the ground by what it would have given back.
#[inline]
#[must_use]
pub fn rebound(restitution: f64, u_N_before: f64) -> f64 {
    restitution * u_N_before.min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_approaching_contact_bounces() {
        assert!((rebound(0.5, -2.0) + 1.0).abs() < 1e-15);
        assert!(rebound(0.5, 4.0).abs() < 1e-15);
    }
}
