//! Which candidates are contacts, rover by rover.

use crate::law::newton_impact::{hovering_height, slow_approach};
use crate::scalar::{Lane, LaneMask, Vec3};

/// Which candidates are contacts: [`crate::contact::Activation`] of each rover.
#[derive(Clone, Copy, Debug)]
pub struct Forecast<T> {
    /// The part of γ h that remains after the configuration in which gaps are measured, s.
    pub lead: f64,
    /// m.
    pub hover: T,
    /// m/s.
    pub slow: T,
}

impl<T: Lane> Forecast<T> {
    /// The forecast of a step of h seconds under gravity (m/s²), for gaps that are measured
    /// `measured` seconds after its start.
    #[must_use]
    pub fn new(gravity: Vec3<T>, h: f64, forecast: f64, measured: f64) -> Self {
        T::vectorize(
            gravity.x.token(),
            #[inline(always)]
            || {
                let g = gravity.norm();
                let h_all = g.like(h);
                Self {
                    lead: forecast * h - measured,
                    hover: hovering_height(g, h_all),
                    slow: slow_approach(g, h_all),
                }
            },
        )
    }

    /// Whether the normal velocity decides for any rover with this gap, m.
    #[inline(always)]
    pub(super) fn needs_velocity(&self, gap: T) -> bool {
        self.lead.abs() > 0.0 || (gap.gt(gap.like(0.0)) & gap.le(self.hover)).any()
    }

    /// Whether candidates with this gap (m) are contacts; `u_N`: normal velocity, m/s, which may be
    /// anything unless [`Self::needs_velocity`].
    #[inline(always)]
    pub(super) fn admits(&self, gap: T, u_N: T) -> T::Mask {
        let zero = gap.like(0.0);
        let hovers = gap.le(self.hover) & u_N.abs().le(self.slow);
        if self.lead.abs() > 0.0 {
            !(gap + gap.like(self.lead) * u_N).gt(zero) | hovers
        } else {
            !gap.gt(zero) | hovers
        }
    }

    /// Distance from the surface within which a part no point of which is faster than `speed` (m/s)
    /// can be in contact, m.
    #[inline(always)]
    pub(super) fn reach(&self, speed: impl FnOnce() -> T) -> T {
        if self.lead.abs() > 0.0 {
            let margin = speed();
            (margin * margin.like(self.lead.abs())).max(self.hover)
        } else {
            self.hover
        }
    }
}
