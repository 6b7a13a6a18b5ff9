//! Closed loops in a pass: the sources of the step ([`crate::system::loops`]) over dual numbers,
//! with a factor of M̂ that varies too.

use super::held_tree::TangentScene;
use super::scratch::{Tangent, VaryingLoops};
use crate::multibody::loops::Placed;
use crate::scalar::{Dual, Lane};
use crate::system::loops::Projector;

impl<T: Lane> Tangent<T> {
    /// Closes the loops at the start of the step, where what varies would open them.
    pub(super) fn close_start(&mut self, scene: &TangentScene<'_>) {
        let Some(VaryingLoops { loops, factor }) = &mut self.loops else {
            return;
        };
        let (mechanism, inertias) = (scene.model.mechanism(), &self.inertias);
        (self.poses_middle).update(mechanism, inertias, &self.start);
        (self.mass_matrix).update(mechanism, inertias, &self.poses_middle);
        self.mass_matrix.factorise(mechanism, factor);
        let with = Projector {
            mechanism,
            inertias,
            factor,
            lanes: !Dual::<T>::mask(self.token, 0),
        };
        loops.project(&with, &mut self.start, &mut self.v);
    }

    /// The loops' rows at the midpoint, once M̂ is known.
    pub(super) fn begin_loops(&mut self, scene: &TangentScene<'_>) {
        let Some(VaryingLoops { loops, factor }) = &mut self.loops else {
            return;
        };
        let mechanism = scene.model.mechanism();
        self.mass_matrix.factorise(mechanism, factor);
        let placed = Placed {
            mechanism,
            poses: &self.poses_middle,
            joints: &self.middle.joints,
        };
        loops.begin(&placed, factor, 0);
    }

    /// `y ← M̂⁻¹ y` of a machine with loops; `closes`: to a change of `v` after which the mean
    /// velocity obeys them.
    #[inline(always)]
    pub(super) fn solve_with_loops(&mut self, scene: &TangentScene<'_>, closes: bool) {
        let Some(VaryingLoops { loops, factor }) = &mut self.loops else {
            return;
        };
        let mechanism = scene.model.mechanism();
        factor.half_solve(mechanism, &mut self.y);
        if closes {
            loops.close(scene.options.theta, &self.v, &self.v, &mut self.y);
        } else {
            loops.restrict(&mut self.y);
        }
        factor.half_solve_back(mechanism, &mut self.y);
    }

    /// Closes the loops at the end of the step; `is_projected`: after the projection out of
    /// penetration.
    pub(super) fn close_end(&mut self, scene: &TangentScene<'_>, is_projected: bool) {
        let Some(VaryingLoops { loops, factor }) = &mut self.loops else {
            return;
        };
        let with = Projector {
            mechanism: scene.model.mechanism(),
            inertias: &self.inertias,
            factor,
            lanes: !Dual::<T>::mask(self.token, 0),
        };
        let q = if is_projected {
            &mut self.reached
        } else {
            &mut self.end
        };
        loops.project_end(&with, q, &mut self.v_end);
    }
}
