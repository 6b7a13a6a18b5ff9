//! Slots of a machine for contacts of any part.
//!
//! A contact of a body fits any slot whose path of velocities begins with the body's. Boxes and
//! balls seldom touch the ground, so they have no slots of their own: they take free ones of wheels
//! further out on their tree, or one of these. A contact between two bodies moves velocities on two
//! paths, so its slot has all of them.

use std::sync::Arc;

use super::machine::{Machine, WheelDisc};
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

    /// Number of slots of the wheels and stops.
    fn n_own_slots(&self) -> usize {
        let of_wheels = self.wheels.iter().map(WheelDisc::n_slots).sum::<usize>();
        of_wheels + self.stops.len()
    }

    /// Bodies whose path each slot has, in order; `None`: all velocities.
    pub(super) fn slot_bodies(&self) -> Vec<Option<usize>> {
        let wheels = (self.wheels.iter())
            .flat_map(|wheel| std::iter::repeat_n(Some(wheel.body), wheel.n_slots()));
        let stops = (self.stops.iter()).map(|stop| Some(self.joints[stop.joint].body));
        wheels
            .chain(self.spares.iter().copied())
            .chain(stops)
            .collect()
    }

    /// Pattern of the problems of all slots, if they have room. Where bodies touch each other, or a
    /// coupled joint follows one with other carriers, it has all entries.
    pub(super) fn find_pattern(&self) -> Option<Arc<Pattern>> {
        let bodies = self.slot_bodies();
        if bodies.len() > MAX_CONTACTS {
            return None;
        }
        let whole: Vec<usize> = (0..self.nv()).collect();
        let paths = (bodies.iter()).map(|body| body.map(|body| self.path(body).to_vec()));
        let own = paths.collect::<Option<Vec<_>>>();
        let of_tree = own.and_then(|paths| Pattern::new(self.nv(), &paths));
        let pattern = of_tree.or_else(|| Pattern::new(self.nv(), &vec![whole; bodies.len()]));
        pattern.map(Arc::new)
    }

    /// Whether all that moves a body also moves another one.
    pub(super) fn carries(&self, body: usize, other: usize) -> bool {
        self.path(other).starts_with(self.path(body))
    }
}
