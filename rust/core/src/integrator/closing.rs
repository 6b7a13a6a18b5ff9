//! Closed loops at the end of a step.

use super::data::{DataOf, Obstacle};
use super::dynamics::Dynamics;
use super::local::Local;
use super::systems::{MaskOf, Systems};
use crate::contact::loops::MOST_OPEN;
use crate::scalar::{Lane, LaneMask};

/// Makes the end of the step obey the closed loops in some lanes. One whose loops stay open falls
/// back.
pub(super) fn close_end<S: Systems>(s: &mut S, d: &mut DataOf<S>, lanes: MaskOf<S>) {
    let Some(gap) = (s.machine_mut()).close_end(lanes, Local::flat(&d.p), &mut d.end, &mut d.v_end)
    else {
        return;
    };
    d.fall_back(Obstacle::Loop, !gap.le(gap.like(MOST_OPEN)) & lanes);
    for lane in (0..S::T::LANES).filter(|&lane| lanes.get(lane)) {
        d.reports[lane].enter_loops(gap.get(lane));
    }
}
