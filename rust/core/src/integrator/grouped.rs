//! Groups of clusters that touch each other, lane by lane.
//!
//! A *cluster* is a part of a system that is coupled to the rest by contacts alone: of a model, the
//! trees that closed loops tie together. Clusters whose contacts touch each other form a *group*.
//! Whether contacts persist, whether gyroscopic terms are implicit, how far the energy audit
//! corrects the velocity and how far positions are projected are decisions of a group: what happens
//! in another one has no influence on it.
//!
//! What a group decides is kept by cluster. A group is led by its first cluster: sums over a group
//! are those of its leader, and 0 of its other clusters.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::{Lane, LaneMask};

/// The contacts of systems in the lanes of a register, each at a place that all lanes share, and
/// which clusters they join.
pub(crate) trait Grouped<T: Lane> {
    /// Token of the scalar.
    fn token(&self) -> T::Token;

    /// Places with a contact in any lane, ascending.
    fn used(&self) -> impl Iterator<Item = usize>;

    /// Lanes with a contact at a place.
    fn active(&self, place: usize) -> T::Mask;

    /// Gap at the end of the step as predicted, m.
    fn gap(&self, place: usize) -> T;

    /// Whether the contact is one with the world.
    fn is_with_world(&self, place: usize) -> bool;

    /// Number of clusters.
    fn n_clusters(&self) -> usize;

    /// Lanes in which clusters touch each other.
    fn joined(&self) -> u32;

    /// The first cluster of a cluster's group in a lane.
    fn leader(&self, cluster: usize, lane: usize) -> usize;

    /// The cluster of a place that is not for contacts between bodies.
    fn cluster_of(&self, place: usize) -> Option<usize>;

    /// The leader of the group of a place's contact in a lane.
    fn group_leader(&self, place: usize, lane: usize) -> usize;

    /// Lanes in which a cluster leads its group.
    #[inline(always)]
    fn leads(&self, cluster: usize) -> T::Mask {
        if self.joined() == 0 {
            return T::mask(self.token(), u32::MAX >> (32 - T::LANES));
        }
        let mut lanes = 0;
        for lane in 0..T::LANES {
            lanes |= u32::from(self.leader(cluster, lane) == cluster) << lane;
        }
        T::mask(self.token(), lanes)
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
    fn gather(&self, sums: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let sum = sums[leader].get(lane) + sums[cluster].get(lane);
            sums[leader].set(lane, sum);
            sums[cluster].set(lane, 0.0);
        });
    }

    /// Gives every cluster the least number of its group.
    #[inline(always)]
    fn spread_least(&self, numbers: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let least = numbers[leader].get(lane).min(numbers[cluster].get(lane));
            numbers[leader].set(lane, least);
        });
        self.spread(numbers);
    }

    /// Gives every cluster the number of its group's leader.
    #[inline(always)]
    fn spread(&self, numbers: &mut [T]) {
        self.follow(|lane, cluster, leader| {
            let number = numbers[leader].get(lane);
            numbers[cluster].set(lane, number);
        });
    }

    /// Marks every cluster of a group of which any is marked.
    #[inline(always)]
    fn unite(&self, masks: &mut [T::Mask]) {
        for _ in 0..2 {
            self.follow(|lane, cluster, leader| {
                let own = T::mask(self.token(), 1 << lane);
                let both = (masks[leader] | masks[cluster]) & own;
                masks[leader] = masks[leader] | both;
                masks[cluster] = masks[cluster] | both;
            });
        }
    }

    /// Leaves marked the clusters of a group of which all are.
    #[inline(always)]
    fn intersect(&self, masks: &mut [T::Mask]) {
        for _ in 0..2 {
            self.follow(|lane, cluster, leader| {
                let others = !T::mask(self.token(), 1 << lane);
                let both = masks[leader] & masks[cluster];
                masks[leader] = masks[leader] & (both | others);
                masks[cluster] = masks[cluster] & (both | others);
            });
        }
    }

    /// Calls `each(lane, leader)` for the lanes of a place of contacts between bodies.
    #[inline(always)]
    fn each_lane(&self, place: usize, mut each: impl FnMut(usize, usize)) {
        let mut lanes = self.active(place).bits();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            each(lane, self.group_leader(place, lane));
        }
    }

    /// Adds the number of a place to the sums of the clusters.
    #[inline(always)]
    fn add(&self, place: usize, x: T, sums: &mut [T]) {
        if let [only] = sums {
            *only += x;
        } else if let Some(cluster) = self.cluster_of(place) {
            sums[cluster] += x;
        } else {
            self.each_lane(place, |lane, leader| {
                let sum = sums[leader].get(lane) + x.get(lane);
                sums[leader].set(lane, sum);
            });
        }
    }

    /// Lowers the least number of the cluster of a place to that of the place.
    #[inline(always)]
    fn lower(&self, place: usize, x: T, least: &mut [T]) {
        if let [only] = least {
            *only = only.min(x);
        } else if let Some(cluster) = self.cluster_of(place) {
            least[cluster] = least[cluster].min(x);
        } else {
            self.each_lane(place, |lane, leader| {
                let lower = least[leader].get(lane).min(x.get(lane));
                least[leader].set(lane, lower);
            });
        }
    }

    /// Marks the cluster of a place in some lanes.
    #[inline(always)]
    fn mark(&self, place: usize, lanes: T::Mask, masks: &mut [T::Mask]) {
        if let [only] = masks {
            *only = *only | lanes;
        } else if let Some(cluster) = self.cluster_of(place) {
            masks[cluster] = masks[cluster] | lanes;
        } else {
            self.each_lane(place, |lane, leader| {
                masks[leader] = masks[leader] | (lanes & T::mask(self.token(), 1 << lane));
            });
        }
    }

    /// Lanes in which the cluster of a place is marked.
    #[inline(always)]
    fn mask_of(&self, place: usize, masks: &[T::Mask]) -> T::Mask {
        if let [only] = masks {
            return *only;
        }
        if let Some(cluster) = self.cluster_of(place) {
            return masks[cluster];
        }
        let mut lanes = 0;
        self.each_lane(place, |lane, leader| {
            lanes |= masks[leader].bits() & 1 << lane;
        });
        T::mask(self.token(), lanes)
    }

    /// The number of the cluster of a place.
    #[inline(always)]
    fn number_of(&self, place: usize, numbers: &[T]) -> T {
        if let [only] = numbers {
            return *only;
        }
        if let Some(cluster) = self.cluster_of(place) {
            return numbers[cluster];
        }
        let mut number = numbers[0];
        self.each_lane(place, |lane, leader| {
            number.set(lane, numbers[leader].get(lane));
        });
        number
    }

    /// `masks`: by cluster, lanes in which its group has a contact.
    #[inline(always)]
    fn find_touch(&self, masks: &mut [T::Mask]) {
        masks.fill(T::mask(self.token(), 0));
        for place in self.used() {
            self.mark(place, self.active(place), masks);
        }
        self.unite(masks);
    }

    /// `masks`: by cluster, lanes in which its group has a contact with the world.
    #[inline(always)]
    fn find_ground(&self, masks: &mut [T::Mask]) {
        masks.fill(T::mask(self.token(), 0));
        for place in self.used() {
            if self.is_with_world(place) {
                self.mark(place, self.active(place), masks);
            }
        }
        self.unite(masks);
    }
}
