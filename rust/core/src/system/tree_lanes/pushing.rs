//! Wrenches that act on trees in lanes from outside.

use super::TreeLanes;
use crate::integrator::Work;
use crate::multibody::LaneConfiguration;
use crate::scalar::{Lane, Vec3};
use crate::system::command::add_wrench;

impl<T: Lane> TreeLanes<T> {
    /// Whether anything pushes a rover.
    #[inline(always)]
    fn is_pushed(&self) -> bool {
        self.wrenches.iter().any(|own| !own.is_empty())
    }

    /// `applied`: generalized force of the wrenches at the midpoint. The first wrenches of all
    /// lanes that are on one body are added at once, then the second ones.
    pub(super) fn apply_wrenches(&mut self, middle: &LaneConfiguration<T>) {
        if !self.is_pushed() {
            return;
        }
        let none = Vec3::splat(self.token, [0.0; 3]);
        self.applied.fill(none.x);
        let most = self.wrenches.iter().map(Vec::len).max().unwrap_or(0);
        for place in 0..most {
            let mut left: Vec<(usize, usize, [[f64; 3]; 3])> = (0..T::LANES)
                .filter_map(|lane| {
                    let (model, own) = (self.models[lane].as_ref()?, &self.wrenches[lane]);
                    let wrench = own.get(place)?;
                    Some((wrench.body(model), lane, wrench.on_body(model)))
                })
                .collect();
            while let Some(&(body, ..)) = left.first() {
                let mut all = [none; 3];
                left.retain(|&(own, lane, numbers)| {
                    for (all, own) in all.iter_mut().zip(numbers).filter(|_| own == body) {
                        all.set(lane, own);
                    }
                    own != body
                });
                let R = self.poses_middle.spun(&self.mechanism, middle, body);
                let placed = (&self.poses_middle, &R);
                add_wrench(&self.mechanism, body, all, placed, &mut self.applied);
            }
        }
    }

    /// Adds the impulse of the wrenches over the step, of length `h`.
    #[inline(always)]
    pub(super) fn push(&self, h: T, out: &mut [T]) {
        if self.is_pushed() {
            for (out, force) in out.iter_mut().zip(&self.applied) {
                *out += h * *force;
            }
        }
    }

    /// Adds the work of the wrenches on each cluster over the step, J.
    #[inline(always)]
    pub(super) fn add_work_of_wrenches(
        &self,
        (h, theta): (T, T),
        [v, v_end]: [&[T]; 2],
        out: &mut [Work<T>],
    ) {
        if !self.is_pushed() {
            return;
        }
        let velocities = v.iter().zip(v_end);
        for (k, (force, (v, v_end))) in self.applied.iter().zip(velocities).enumerate() {
            let mean = theta * *v_end + (h.like(1.0) - theta) * *v;
            let cluster = self.mechanism.cluster_of_velocity(k);
            out[cluster].supplied += h * *force * mean;
        }
    }

    /// Work of the wrenches over a displacement (nv), J.
    pub(super) fn work_on_the_way(&self, displacement: &[T]) -> T {
        let mut sum = self.number(0.0);
        if self.is_pushed() {
            for (force, way) in self.applied.iter().zip(displacement) {
                sum += *force * *way;
            }
        }
        sum
    }
}
