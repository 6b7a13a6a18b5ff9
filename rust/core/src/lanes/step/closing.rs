//! Closed loops at the end of a step, see [`crate::system::loops`].

use super::{Block, Fallback};
use crate::integrator::report::MOST_OPEN;
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::system::loops::Projector;

impl<T: Lane> Block<T> {
    /// Projects configuration and velocity at the end of the step onto the loops, in the lanes of a
    /// mask. A lane whose loops stay open falls back.
    pub(super) fn close_end(&mut self, lanes: T::Mask) {
        let Some(loops) = &mut self.rows.loops else {
            return;
        };
        let with = Projector {
            mechanism: &self.machine,
            inertias: &self.inertias,
            factor: &self.factor,
            lanes,
        };
        let gap = loops.project_position(&with, &mut self.end);
        let v_end = &mut self.v_end;
        T::vectorize(
            self.token,
            #[inline(always)]
            || loops.project_velocity(&with, v_end),
        );
        self.fall_back(Fallback::Loop, !gap.le(gap.like(MOST_OPEN)) & lanes);
        let mut gaps = [0.0; MAX_LANES];
        gap.store(&mut gaps[..T::LANES]);
        for (lane, gap) in gaps.iter().enumerate().take(T::LANES) {
            if lanes.get(lane) {
                self.reports[lane].enter_loops(*gap);
            }
        }
    }
}
