//! Newton's impact law `u_N⁺ + e u_N⁻ ≥ 0`, folded into the free velocity of the friction-contact problem.

/// Adds `e u_N⁻` to the normal free velocity of one contact, so that the problem's `u_N` means `u_N⁺ + e u_N⁻`.
///
/// `q`: free local velocity `[normal, tangent, (tangent)]` of the contact, m/s, changed in place.
/// `restitution`: `e` in `[0, 1]`. `u_N_before`: normal velocity before the impact, m/s; only an approaching
/// contact (`u_N⁻ < 0`) bounces.
#[inline]
pub fn add_restitution(q: &mut [f64], restitution: f64, u_N_before: f64) {
    if let Some(normal) = q.first_mut() {
        *normal += restitution * u_N_before.min(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_approaching_contact_bounces() {
        let mut q = [-1.0, 0.3];
        add_restitution(&mut q, 0.5, -2.0);
        assert!((q[0] + 2.0).abs() < 1e-15);
        add_restitution(&mut q, 0.5, 4.0);
        assert!((q[0] + 2.0).abs() < 1e-15);
    }
}
