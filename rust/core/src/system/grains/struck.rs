//! Pairs that only an impact within the step brings together.
//!
//! Detection forecasts with the velocities before the step. A grain that a wheel throws in this
//! step flies past what it looked at and would end inside another. Such pairs are found from the
//! velocities after the step, which is then repeated with them among its contacts.

use super::bodies::COORDINATES;
use super::contact::WALL;
use super::detection::direction;
use super::grid::Item;
use super::struck_pairs::Struck;
use super::system::GrainSystem;
use crate::problem::BodyPairs;
use crate::solver::Swept;
use crate::spatial::space::{body_velocities, dot, length};
use nalgebra::SVector;

/// Overlap at the end of the step that counts, as a fraction of the smallest radius. Contacts that
/// were found end with a thousandth of that.
const OVERLAPS: f64 = 0.01;

impl<const D: usize> GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    /// Finds pairs that end the step inside each other and that it has not looked at. `before`,
    /// `after`: velocities at its two ends. Whether there are any.
    pub(super) fn find_struck(&mut self, before: &[f64], after: &[f64]) -> bool {
        let V = body_velocities(D);
        let search = self.parts.search;
        let (radius, largest) = (self.scene.grains.radius(), self.scene.grains.largest());
        let limit = OVERLAPS * self.scene.grains.smallest();
        let speed = |i: usize| length(&velocity::<D>(after, V, i));
        let fastest = (0..radius.len()).map(speed).fold(0.0, f64::max);
        if search.lead * fastest <= search.skin {
            return false;
        }
        let mut struck = std::mem::take(&mut self.parts.struck);
        let n_before = struck.n();
        let is_fast = |i: &usize| search.lead * speed(*i) > search.skin;
        for i in (0..radius.len()).filter(is_fast) {
            let centre = self.centre(i);
            let own: [f64; D] = velocity(after, V, i);
            let reach = search.lead * (speed(i) + fastest);
            let meet = |item: &Item<D>| {
                let j = item.index as usize;
                let between: [f64; D] = std::array::from_fn(|k| centre[k] - item.centre[k]);
                let sizes = radius[i] + item.radius;
                if j == i || dot(&between, &between) > (sizes + reach) * (sizes + reach) {
                    return;
                }
                let other: [f64; D] = velocity(after, V, j);
                let closer = |k: usize| between[k] + search.lead * (own[k] - other[k]);
                let end: [f64; D] = std::array::from_fn(closer);
                if length(&end) - sizes > -limit {
                    return;
                }
                let (n, gap) = (direction(&between), length(&between) - sizes);
                let [a, b]: [[f64; D]; 2] = [i, j].map(|i| velocity(before, V, i));
                let u_N: f64 = (0..D).map(|k| n[k] * (a[k] - b[k])).sum();
                if !search.admits(gap, u_N) {
                    struck.add(i.min(j), i.max(j), gap);
                }
            };
            (self.parts.grid).near(&centre, radius[i] + largest + reach, meet);
        }
        for i in (0..radius.len()).filter(is_fast) {
            self.find_struck_fixed(i, (before, after), limit, &mut struck);
        }
        let is_new = struck.n() > n_before;
        self.parts.struck = struck;
        is_new
    }

    /// Centre of a grain at the start of the step, m.
    fn centre(&self, i: usize) -> [f64; D] {
        let own = &self.parts.middle[COORDINATES * i..];
        std::array::from_fn(|k| own[k])
    }

    /// Adds grain `i` to `struck` if it ends the step in a wall or in the ground and no contact
    /// with either was forecast. `before`, `after`: velocities at the two ends of the step.
    fn find_struck_fixed(
        &mut self,
        i: usize,
        (before, after): (&[f64], &[f64]),
        limit: f64,
        struck: &mut Struck,
    ) {
        let (V, search) = (body_velocities(D), self.parts.search);
        let start = SVector::from(self.centre(i));
        let [slow, fast] = [before, after].map(|v| SVector::from(velocity::<D>(v, V, i)));
        let end = start + fast * search.lead;
        let radius = self.scene.grains.radius()[i];
        let mut deepest = f64::INFINITY;
        let mut is_known = false;
        let mut meet = |n: SVector<f64, D>, gap: f64, motion: SVector<f64, D>| {
            is_known |= search.admits(gap, n.dot(&(slow - motion)));
            deepest = deepest.min(gap + search.lead * n.dot(&(fast - motion)));
        };
        for wall in &self.scene.walls {
            let gap = wall.at(self.parts.wall_time).distance(&start) - radius;
            meet(wall.n(), gap, wall.velocity());
        }
        if let Some(ground) = &self.scene.ground {
            let facing = &mut self.parts.facing;
            facing.clear();
            ground.facing(&start, radius + search.reach, facing);
            for facing in &*facing {
                meet(facing.n, facing.distance - radius, ground.velocity(facing));
            }
            facing.clear();
            ground.facing(&end, radius, facing);
            for facing in &*facing {
                deepest = deepest.min(facing.distance - radius);
            }
        }
        if deepest < -limit && !is_known {
            struck.add(i, WALL as usize, search.lead * fast.norm());
        }
    }
}

/// Velocity of a grain's centre, m/s.
#[inline]
fn velocity<const D: usize>(v: &[f64], width: usize, i: usize) -> [f64; D] {
    std::array::from_fn(|k| v[width * i + k])
}
