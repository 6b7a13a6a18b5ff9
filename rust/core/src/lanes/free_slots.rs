//! Slots of a machine for contacts of any part.
//!
//! A contact of a body fits any slot whose path of velocities begins with the body's. Boxes and
//! balls seldom touch the ground, so they have no slots of their own: they take free ones of wheels
//! further out on their tree, or one of these. A contact between two bodies moves velocities on two
//! paths, so its slot has all of them.

use std::sync::Arc;

use super::machine::Machine;
use super::pattern::Pattern;
use super::problem::MAX_CONTACTS;

/// Slots for a path with boxes or balls.
const FOR_BODIES: usize = 4;

/// Slots for contacts between bodies.
const FOR_PAIRS: usize = 6;

impl Machine {
    /// Bodies whose path the further slots have, as far as there is room; `None`: all velocities.
    /// `has_pairs`: whether bodies can touch each other.
    pub(super) fn find_free_slots(&self, has_pairs: bool) -> Vec<Option<usize>> {
        let wheels = || self.wheels.iter().map(|wheel| wheel.body);
        let bodies = || self.boxes.iter().map(|solid| solid.body);
        let is_on_wheel = |body: usize| wheels().any(|wheel| self.carries(body, wheel));
        let mut ends: Vec<usize> = Vec::new();
        for body in bodies().filter(|&body| !is_on_wheel(body)) {
            if !ends.iter().any(|&end| self.carries(body, end)) {
                ends.retain(|&end| !self.carries(end, body));
                ends.push(body);
            }
        }
        ends.extend(wheels().next().filter(|_| bodies().any(is_on_wheel)));
        let room = MAX_CONTACTS.saturating_sub(self.n_own_slots());
        let for_bodies = ends.iter().flat_map(|&end| [Some(end); FOR_BODIES]);
        let for_pairs = [None; FOR_PAIRS].into_iter().filter(|_| has_pairs);
        for_pairs.chain(for_bodies).take(room).collect()
    }

    /// Number of slots of the wheels and joints.
    fn n_own_slots(&self) -> usize {
        let of_wheels = self.wheels.iter().map(|wheel| wheel.n_slots).sum::<usize>();
        of_wheels + self.stops.len() + self.rubbing.len()
    }

    /// Joints with slots of their own: those with stops, then those with dry friction.
    pub(super) fn joints_with_slots(&self) -> impl Iterator<Item = usize> {
        let stops = self.stops.iter().map(|stop| stop.joint);
        stops.chain(self.rubbing.iter().copied())
    }

    /// Bodies whose path each slot has, in order; `None`: all velocities.
    pub(super) fn slot_bodies(&self) -> Vec<Option<usize>> {
        let wheels = (self.wheels.iter())
            .flat_map(|wheel| std::iter::repeat_n(Some(wheel.body), wheel.n_slots));
        let joints = (self.joints_with_slots()).map(|joint| Some(self.joints[joint].body));
        wheels
            .chain(self.spares.iter().copied())
            .chain(joints)
            .collect()
    }

    /// Pattern of the problems of all slots. Where loops are closed, bodies touch each other, or a
    /// coupled joint follows one with other carriers, it has all entries.
    pub(super) fn find_pattern(&self) -> Arc<Pattern> {
        let bodies = self.slot_bodies();
        let paths = (bodies.iter()).map(|body| body.map(|body| self.path(body).to_vec()));
        let own = paths.collect::<Option<Vec<_>>>();
        let own = own.filter(|_| self.loops.is_empty());
        let of_tree = own.and_then(|paths| Pattern::new(self.nv(), &paths));
        Arc::new(of_tree.unwrap_or_else(|| Pattern::whole(self.nv(), bodies.len())))
    }

    /// Whether all that moves a body also moves another one.
    pub(super) fn carries(&self, body: usize, other: usize) -> bool {
        self.path(other).starts_with(self.path(body))
    }
}
