//! Activation: which candidates enter a step as contacts.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::law::newton_impact::{hovering_height, slow_approach};
use crate::scalar::{Lane, LaneMask, Vec3, inlined};

/// A candidate is active if `gap + lead · u_N ≤ 0`, or if it is nearly at rest within `hover`.
///
/// The first condition is the forecast of Moreau–Jean stepping; `lead` is the part of γ h that
/// remains after the configuration in which the gap was measured. The second keeps a resting
/// contact closed when rounding leaves it slightly above the ground, within `hover` metres and
/// slower than `slow` m/s; without it the body would fall for one step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Activation<T = f64> {
    /// s.
    pub lead: f64,
    /// m.
    pub hover: T,
    /// m/s.
    pub slow: T,
}

impl<T: Lane> Activation<T> {
    /// In a step of h seconds under gravity (m/s²), for gaps that are measured `measured` seconds
    /// after its start; `forecast`: γ.
    #[must_use]
    pub fn of_step(gravity: Vec3<T>, h: f64, forecast: f64, measured: f64) -> Self {
        inlined!(T::vectorize, gravity.x.token(), {
            let g = gravity.norm();
            let h_all = g.like(h);
            Self {
                lead: forecast * h - measured,
                hover: hovering_height(g, h_all),
                slow: slow_approach(g, h_all),
            }
        })
    }

    /// The activation in one lane.
    #[must_use]
    pub(crate) fn of_lane(&self, lane: usize) -> Activation {
        Activation {
            lead: self.lead,
            hover: self.hover.get(lane),
            slow: self.slow.get(lane),
        }
    }

    /// Whether candidates with this gap (m) and normal velocity (m/s, evaluated only if needed) are
    /// active.
    #[inline(always)]
    #[must_use]
    pub fn admits(&self, gap: T, u_N: impl FnOnce() -> T) -> T::Mask {
        let zero = gap.like(0.0);
        if self.lead.abs() > 0.0 {
            let u_N = u_N();
            let hovers = gap.le(self.hover) & u_N.abs().le(self.slow);
            return !(gap + gap.like(self.lead) * u_N).gt(zero) | hovers;
        }
        let (apart, near) = (gap.gt(zero), gap.le(self.hover));
        if (apart & near).any() {
            return !apart | (near & u_N().abs().le(self.slow));
        }
        !apart
    }

    /// Distance from the surface within which a part can be active no point of which is faster than
    /// `speed`, m/s, evaluated only if needed; m.
    #[inline(always)]
    #[must_use]
    pub fn reach(&self, speed: impl FnOnce() -> T) -> T {
        if self.lead.abs() > 0.0 {
            let speed = speed();
            (speed * speed.like(self.lead.abs())).max(self.hover)
        } else {
            self.hover
        }
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
            Activation::<f64>::default().admits(-1.0, || f64::NAN),
            "inside, whatever its velocity"
        );
    }
}
