//! Wheels in sand in a pass.

use super::along;
use super::held_sand::OF_WHEEL;
use super::held_system::HeldSystem;
use super::held_tree::TangentScene;
use crate::scalar::{Dual, Lane};
use crate::system::six::{self, SIX};

impl<T: Lane> HeldSystem<'_, T> {
    /// The wrenches of the sand with their derivative at a held velocity at the end of the step,
    /// and their impulse, which is given.
    #[inline(always)]
    pub(super) fn press_sand(&mut self) {
        let own = &mut *self.own;
        let (Some(sand), Some(held)) = (&mut own.sand, &self.scene.held.sand) else {
            return;
        };
        let h = self.scene.options.time_step;
        let zero = Dual::splat(own.tree.token, 0.0);
        let mut v_end = vec![zero; held.v_end.len()];
        for (own, v) in v_end.iter_mut().zip(&held.v_end) {
            *own = zero.like(*v);
        }
        own.tree.given.fill(zero);
        for (wheel, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            wheel.pose = wheel.map.place(&wheel.wheel, &own.tree.poses_middle);
            let twist = wheel.map.twist(&v_end);
            let end = wheel.recalled(&twist, (sand.length.like(h), sand.length));
            wheel.press(held, &twist, &end, self.scene.options.theta * h);
            wheel.map.add_impulse(&wheel.wrench, h, &mut own.tree.given);
        }
        sand.changes.clear();
    }

    /// How the wrenches of the sand change by the derivative `dv` (nv) of the velocity at the end
    /// that is known with wrenches at a held velocity. Returns what of that follows for the
    /// velocity; none on firm ground.
    #[inline(always)]
    pub(super) fn yield_sand(&mut self, dv: &[T]) -> Option<Vec<Dual<T>>> {
        let (sand, held) = (self.own.sand.as_mut()?, self.scene.held.sand.as_ref()?);
        let zero = sand.length.slope.like(0.0);
        let before = std::mem::take(&mut sand.changes);
        for row in held.feedback.chunks_exact(dv.len()) {
            sand.changes.push(along(row, dv, zero));
        }
        let wrenches = sand.wheels.iter_mut().flat_map(|wheel| &mut wheel.wrench);
        for (k, own) in wrenches.enumerate() {
            // Of a step that is taken again those changes are there already.
            let known = before.get(k).copied().unwrap_or(zero);
            own.slope += sand.changes[k] - known;
        }
        let mut more = vec![Dual::constant(zero); dv.len()];
        let rows = held.response.chunks_exact(sand.changes.len());
        for (own, row) in more.iter_mut().zip(rows) {
            own.slope = along(row, &sand.changes, zero);
        }
        Some(more)
    }

    /// Adds the impulse of these changes (nv).
    #[inline(always)]
    pub(super) fn add_changes_of_sand(&self, impulse: &mut [Dual<T>]) {
        let Some(sand) = &self.own.sand else {
            return;
        };
        let h = self.scene.options.time_step;
        let changes = sand.changes.chunks_exact(SIX);
        for (wheel, changes) in sand.wheels.iter().zip(changes) {
            let zero = changes[0].like(0.0);
            let change = std::array::from_fn(|k| Dual::new(zero, changes[k]));
            wheel.map.add_impulse(&change, h, impulse);
        }
    }

    /// What the sand remembers after a step between two velocities (nv).
    #[inline(always)]
    pub(super) fn recall_sand(&mut self, [v, v_end]: [&[Dual<T>]; 2]) {
        let (Some(sand), Some(held)) = (&mut self.own.sand, &self.scene.held.sand) else {
            return;
        };
        let (length, zero) = (sand.length, sand.length.like(0.0));
        let (h, theta) = (
            zero.like(self.scene.options.time_step),
            zero.like(self.scene.options.theta),
        );
        for (own, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            let twist = own.map.twist(v_end);
            let end = own.recalled(&twist, (h, length));
            own.end = end.map(|x| x * zero.like(held.kept));
            own.left = zero;
            if held.is_touching {
                let before = own.map.twist(v).map(|x| x * (zero.like(1.0) - theta));
                let mean = six::plus(&before, theta, &twist);
                let wanted = h * six::dot(&own.wrench, &mean);
                let given = wanted.min(own.stored);
                let force = six::linear(&own.wrench).norm();
                let force = Dual::select(zero.lt(force), force, zero);
                own.left = (own.stored - given).min(length * force);
            }
        }
    }
}

/// Number of entries of the state of the sand.
pub(super) fn n_of_sand(scene: &TangentScene<'_>) -> usize {
    let wheels = scene.held.sand.as_ref().map_or(0, |held| held.wheels.len());
    OF_WHEEL * wheels
}
