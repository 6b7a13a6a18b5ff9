//! Signorini's condition at velocity level, `0 ≤ u_N ⊥ p_N ≥ 0`.

/// Violation of `0 ≤ u_N ⊥ p_N ≥ 0` as a velocity, `|min(u_N, p_N/ρ)|` (m/s).
///
/// `u_N`: normal velocity after the impact, m/s, restitution already added. `p_N`: normal impulse,
/// N s. `rho`: scale in kg that turns a velocity into an impulse, about `1/W_NN`.
#[inline]
#[must_use]
pub fn violation(u_N: f64, p_N: f64, rho: f64) -> f64 {
    let pressed = p_N / rho;
    // A NaN velocity stays NaN.
    if pressed <= u_N {
        pressed.abs()
    } else {
        u_N.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separated_and_pressed_contacts_satisfy_the_law() {
        assert!(violation(2.0, 0.0, 1.0) < 1e-15);
        assert!(violation(0.0, 2.0, 1.0) < 1e-15);
        assert!(
            (violation(-0.5, 0.0, 1.0) - 0.5).abs() < 1e-15,
            "penetrates"
        );
        assert!(
            (violation(0.0, -3.0, 2.0) - 1.5).abs() < 1e-15,
            "sticks like glue"
        );
    }
}
