//! Slots of a machine for contacts of any part.
//!
//! A contact of a body fits any slot whose path of velocities begins with the body's. Boxes and
//! balls seldom touch the ground, so they have no slots of their own: they take free ones of wheels
//! further out on their tree, or one of these. A contact between two bodies moves velocities on two
//! paths, so its slot has all of them.

use super::machine::SharedMachine;
use crate::solver::batch::problem::MAX_CONTACTS;

/// Slots for a path with boxes or balls.
const FOR_BODIES: usize = 4;

/// Slots for contacts between bodies, for each tree, and most of a machine.
const FOR_PAIRS: usize = 6;
const MOST_FOR_PAIRS: usize = 24;

impl SharedMachine {
    /// Bodies whose path the further slots have, as far as the pattern of their cluster has room if
    /// it is one along paths; `None`: all velocities.
    pub(crate) fn find_free_slots(&self) -> Vec<Option<usize>> {
        let n_pairs = (FOR_PAIRS * self.trees.len()).min(MOST_FOR_PAIRS);
        let for_pairs = std::iter::repeat_n(None, if self.has_pairs { n_pairs } else { 0 });
        let for_bodies = (0..self.clusters.n()).flat_map(|own| self.find_slots_of_bodies(own));
        for_pairs.chain(for_bodies.map(Some)).collect()
    }

    fn find_slots_of_bodies(&self, cluster: usize) -> Vec<usize> {
        let is_own = |body: &usize| self.cluster_of(*body) == cluster;
        let wheels = || (self.wheels.iter().map(|wheel| wheel.body)).filter(is_own);
        let bodies = || (self.boxes.iter().map(|solid| solid.body)).filter(is_own);
        let is_on_wheel = |body: usize| wheels().any(|wheel| self.carries(body, wheel));
        let mut ends: Vec<usize> = Vec::new();
        for body in bodies().filter(|&body| !is_on_wheel(body)) {
            if !ends.iter().any(|&end| self.carries(body, end)) {
                ends.retain(|&end| !self.carries(end, body));
                ends.push(body);
            }
        }
        ends.extend(wheels().next().filter(|_| bodies().any(is_on_wheel)));
        let of_wheels = self.wheels.iter().filter(|wheel| is_own(&wheel.body));
        let n_of_wheels = of_wheels.map(|wheel| wheel.n_slots).sum::<usize>();
        let of_joints = self
            .joints_with_slots()
            .map(|joint| self.joints[joint].body);
        let n_of_joints = of_joints.filter(is_own).count();
        let room = MAX_CONTACTS.checked_sub(n_of_wheels + n_of_joints);
        let room = room.unwrap_or(usize::MAX);
        let slots = ends.iter().flat_map(|&end| [end; FOR_BODIES]);
        slots.take(room).collect()
    }

    /// Joints with slots of their own: those with stops, then those with dry friction.
    pub(crate) fn joints_with_slots(&self) -> impl Iterator<Item = usize> {
        let stops = self.stops.iter().map(|stop| stop.joint);
        stops.chain(self.rubbing.iter().copied())
    }

    /// Bodies whose path each slot has, in order; `None`: all velocities.
    pub(crate) fn slot_bodies(&self) -> Vec<Option<usize>> {
        let wheels = (self.wheels.iter())
            .flat_map(|wheel| std::iter::repeat_n(Some(wheel.body), wheel.n_slots));
        let joints = (self.joints_with_slots()).map(|joint| Some(self.joints[joint].body));
        wheels
            .chain(self.spares.iter().copied())
            .chain(joints)
            .collect()
    }

    /// Whether all that moves a body also moves another one.
    pub(crate) fn carries(&self, body: usize, other: usize) -> bool {
        self.tree_of_body(body) == self.tree_of_body(other)
            && self.path(other).starts_with(self.path(body))
    }
}
