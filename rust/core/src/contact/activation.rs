//! Activation: which candidates enter a step as contacts.

/// A candidate is active if `gap + lead · u_N ≤ 0`, or if it is nearly at rest within `hover`.
///
/// The first condition is the forecast of Moreau–Jean stepping; `lead` is the part of γ h that
/// remains after the configuration in which the gap was measured. The second keeps a resting
/// contact closed when rounding leaves it slightly above the ground, within `hover` metres and
/// slower than `slow` m/s; without it the body would fall for one step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Activation {
    /// s.
    pub lead: f64,
    /// m.
    pub hover: f64,
    /// m/s.
    pub slow: f64,
    /// Upper bound of `|lead · u_N|` over the machine, m; limits the search distance.
    pub margin: f64,
}

impl Activation {
    /// Whether a candidate with this gap (m) and normal velocity (m/s, evaluated only if needed) is
    /// active.
    #[inline]
    #[must_use]
    pub fn admits(&self, gap: f64, u_N: impl FnOnce() -> f64) -> bool {
        if self.lead.abs() > 0.0 || gap > 0.0 {
            let u_N = u_N();
            let is_forecast_apart = gap + self.lead * u_N > 0.0;
            !is_forecast_apart || (gap <= self.hover && u_N.abs() <= self.slow)
        } else {
            true
        }
    }

    /// Largest distance from the surface at which a candidate can be active, m, for the bound
    /// `margin`.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.hover.max(self.margin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forecast_meets_what_comes_and_keeps_what_rests() {
        let activation = Activation {
            lead: 0.01,
            hover: 1e-6,
            slow: 0.01,
            margin: 0.0,
        };
        assert!(
            activation.admits(0.005, || -1.0),
            "meets the ground in the step"
        );
        assert!(!activation.admits(0.005, || -0.1), "too slow to reach it");
        assert!(
            activation.admits(1e-7, || 1e-3),
            "rests a rounding error above"
        );
        assert!(!activation.admits(1e-7, || 1.0), "leaves");
        assert!(
            Activation::default().admits(-1.0, || f64::NAN),
            "inside, whatever its velocity"
        );
    }
}
