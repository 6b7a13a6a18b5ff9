//! When a candidate takes part in a step as a contact.

/// A candidate becomes a contact of the step where `gap + lead · u_N ≤ 0`, or nearly at rest within
/// `hover`.
///
/// The first is the forecast of Moreau–Jean stepping; `lead` is what is left of γ h after the
/// configuration that the gap was measured in. The second keeps a contact that rests a rounding
/// error above the ground closed, instead of letting it fall for a step: within `hover` metres and
/// slower than `slow` m/s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Activation {
    /// s.
    pub lead: f64,
    /// m.
    pub hover: f64,
    /// m/s.
    pub slow: f64,
    /// m: a bound of `|lead · u_N|` over the machine, so that the search knows how far to look.
    pub margin: f64,
}

impl Activation {
    /// Whether a candidate with this gap (m) and normal velocity (m/s, asked for only where it
    /// matters) takes part.
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

    /// How far from the surface a candidate can be and still take part, m, given the bound
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
