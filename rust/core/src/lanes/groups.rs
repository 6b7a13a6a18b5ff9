//! Groups of clusters that touch each other, lane by lane; see [`crate::integrator::groups`].
//!
//! What a group decides is kept by cluster. A group is led by its first cluster: sums over a group
//! are those of its leader, and 0 of its other clusters.

use super::contacts::Contacts;
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Contacts<T> {
    /// Lanes in which a cluster leads its group.
    #[inline(always)]
    pub(super) fn leads(&self, cluster: usize) -> T::Mask {
        if self.joined() == 0 {
            return T::mask(self.token, u32::MAX >> (32 - T::LANES));
        }
        let mut lanes = 0;
        for lane in 0..T::LANES {
            lanes |= u32::from(self.leader(cluster, lane) == cluster) << lane;
        }
        T::mask(self.token, lanes)
    }

    /// Calls `each(lane, cluster, leader)` for every cluster that does not lead its group.
    #[inline(always)]
    fn follow(&self, mut each: impl FnMut(usize, usize, usize)) {
        let mut lanes = self.joined();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            for cluster in 0..self.n_clusters() {
                let leader = self.leader(cluster, lane);
                if leader != cluster {
                    each(lane, cluster, leader);
                }
            }
        }
    }

    /// Sums over groups, from those over clusters.
    #[inline(always)]
    pub(super) fn gather(&self, sums: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let sum = sums[leader].get(lane) + sums[cluster].get(lane);
            sums[leader].set(lane, sum);
            sums[cluster].set(lane, 0.0);
        });
    }

    /// Gives every cluster the least number of its group.
    #[inline(always)]
    pub(super) fn spread_least(&self, numbers: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let least = numbers[leader].get(lane).min(numbers[cluster].get(lane));
            numbers[leader].set(lane, least);
        });
        self.spread(numbers);
    }

    /// Gives every cluster the number of its group's leader.
    #[inline(always)]
    pub(super) fn spread(&self, numbers: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let number = numbers[leader].get(lane);
            numbers[cluster].set(lane, number);
        });
    }

    /// Marks every cluster of a group of which any is marked.
    #[inline(always)]
    pub(super) fn unite(&self, masks: &mut [T::Mask]) {
        for _ in 0..2 {
            self.follow(|lane, cluster, leader| {
                let own = T::mask(self.token, 1 << lane);
                let both = (masks[leader] | masks[cluster]) & own;
                masks[leader] = masks[leader] | both;
                masks[cluster] = masks[cluster] | both;
            });
        }
    }

    /// Leaves marked the clusters of a group of which all are.
    #[inline(always)]
    pub(super) fn intersect(&self, masks: &mut [T::Mask]) {
        for _ in 0..2 {
            self.follow(|lane, cluster, leader| {
                let others = !T::mask(self.token, 1 << lane);
                let both = masks[leader] & masks[cluster];
                masks[leader] = masks[leader] & (both | others);
                masks[cluster] = masks[cluster] & (both | others);
            });
        }
    }

    /// Calls `each(lane, cluster)` for the lanes of a slot of contacts between bodies.
    #[inline(always)]
    fn each_lane(&self, slot: usize, mut each: impl FnMut(usize, usize)) {
        let mut lanes = self.slot(slot).active.bits();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            each(lane, usize::from(self.homes(slot)[lane]) / T::LANES);
        }
    }

    /// Adds the number of a slot to the sums of the clusters.
    #[inline(always)]
    pub(super) fn add(&self, slot: usize, x: T, sums: &mut [T]) {
        if let [only] = sums {
            *only += x;
        } else if let Some(cluster) = self.cluster_of(slot) {
            sums[cluster] += x;
        } else {
            self.each_lane(slot, |lane, leader| {
                let sum = sums[leader].get(lane) + x.get(lane);
                sums[leader].set(lane, sum);
            });
        }
    }

    /// Lowers the least number of the cluster of a slot to that of the slot.
    #[inline(always)]
    pub(super) fn lower(&self, slot: usize, x: T, least: &mut [T]) {
        if let [only] = least {
            *only = only.min(x);
        } else if let Some(cluster) = self.cluster_of(slot) {
            least[cluster] = least[cluster].min(x);
        } else {
            self.each_lane(slot, |lane, leader| {
                let lower = least[leader].get(lane).min(x.get(lane));
                least[leader].set(lane, lower);
            });
        }
    }

    /// Marks the cluster of a slot in some lanes.
    #[inline(always)]
    pub(super) fn mark(&self, slot: usize, lanes: T::Mask, masks: &mut [T::Mask]) {
        if let [only] = masks {
            *only = *only | lanes;
        } else if let Some(cluster) = self.cluster_of(slot) {
            masks[cluster] = masks[cluster] | lanes;
        } else {
            self.each_lane(slot, |lane, leader| {
                masks[leader] = masks[leader] | (lanes & T::mask(self.token, 1 << lane));
            });
        }
    }

    /// Lanes in which the cluster of a slot is marked.
    #[inline(always)]
    pub(super) fn mask_of(&self, slot: usize, masks: &[T::Mask]) -> T::Mask {
        if let [only] = masks {
            return *only;
        }
        if let Some(cluster) = self.cluster_of(slot) {
            return masks[cluster];
        }
        let mut lanes = 0;
        self.each_lane(slot, |lane, leader| {
            lanes |= masks[leader].bits() & 1 << lane;
        });
        T::mask(self.token, lanes)
    }

    /// The number of the cluster of a slot.
    #[inline(always)]
    pub(super) fn number_of(&self, slot: usize, numbers: &[T]) -> T {
        if let [only] = numbers {
            return *only;
        }
        if let Some(cluster) = self.cluster_of(slot) {
            return numbers[cluster];
        }
        let mut number = numbers[0];
        self.each_lane(slot, |lane, leader| {
            number.set(lane, numbers[leader].get(lane));
        });
        number
    }
}
