//! Wheels in sand in a pass.

use super::held_sand::OF_WHEEL;
use super::held_tree::TangentScene;
use super::pass::along;
use super::scratch::Tangent;
use crate::scalar::{Dual, Lane};
use crate::system::six::{self, SIX};

impl<T: Lane> Tangent<T> {
    /// `y += h Jᵀ F`, with the derivative at a held velocity at the end of the step.
    #[inline(always)]
    pub(super) fn push_sand(&mut self, scene: &TangentScene<'_>) {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return;
        };
        let h = scene.options.time_step;
        for (own, v) in self.v_end.iter_mut().zip(&held.v_end) {
            *own = Dual::splat(self.token, *v);
        }
        for (own, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            own.pose = own.map.place(&own.wheel, &self.poses_middle);
            let twist = own.map.twist(&self.v_end);
            let end = own.recalled(&twist, (sand.length.like(h), sand.length));
            own.press(held, &twist, &end, scene.options.theta * h);
            own.map.add_impulse(&own.wrench, h, &mut self.y);
        }
    }

    /// Adds to `y` and to the wrenches what follows from the change of the velocity at the end,
    /// which is known with wrenches at a held velocity. False on firm ground.
    #[inline(always)]
    pub(super) fn yield_sand(&mut self, scene: &TangentScene<'_>) -> bool {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return false;
        };
        for (own, v) in sand.dv.iter_mut().zip(&self.v_end) {
            *own = v.slope;
        }
        let zero = sand.length.slope.like(0.0);
        sand.changes.clear();
        for row in held.feedback.chunks_exact(sand.dv.len()) {
            sand.changes.push(along(row, &sand.dv, zero));
        }
        let changes = sand.changes.chunks_exact(SIX);
        for (wheel, changes) in sand.wheels.iter_mut().zip(changes) {
            for (own, change) in wheel.wrench.iter_mut().zip(changes) {
                own.slope += *change;
            }
        }
        let rows = held.response.chunks_exact(sand.changes.len());
        for (y, row) in self.y.iter_mut().zip(rows) {
            y.slope = along(row, &sand.changes, y.slope);
        }
        true
    }

    /// What the sand remembers at the end of the step.
    #[inline(always)]
    pub(super) fn recall_sand(&mut self, scene: &TangentScene<'_>) {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return;
        };
        let (length, zero) = (sand.length, sand.length.like(0.0));
        let (h, theta) = (
            zero.like(scene.options.time_step),
            zero.like(scene.options.theta),
        );
        for (own, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            let twist = own.map.twist(&self.v_end);
            let end = own.recalled(&twist, (h, length));
            own.end = end.map(|x| x * zero.like(held.kept));
            own.left = zero;
            if held.is_touching {
                let before = own.map.twist(&self.v).map(|x| x * (zero.like(1.0) - theta));
                let mean = six::plus(&before, theta, &twist);
                let wanted = h * six::dot(&own.wrench, &mean);
                let given = wanted.min(own.stored);
                let force = six::linear(&own.wrench).norm();
                let force = Dual::select(zero.lt(force), force, zero);
                own.left = (own.stored - given).min(length * force);
            }
        }
    }

    /// Number of entries of the state of the sand.
    pub(super) fn n_of_sand(scene: &TangentScene<'_>) -> usize {
        let wheels = scene.held.sand.as_ref().map_or(0, |held| held.wheels.len());
        OF_WHEEL * wheels
    }
}
