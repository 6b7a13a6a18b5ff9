//! The contacts of a block that are found lane by lane (`lane_detection`).

use super::machine::SharedMachine;
use crate::contact::{Contact, PairSearch, Part};
use crate::scalar::MAX_LANES;

/// A part whose contacts are asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    pub part: Part,
    pub lanes: u32,
}

/// A contact of a lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub lane: usize,
    pub contact: Contact,
    /// Whether the path of its slot is not its body's.
    pub is_off_path: bool,
}

/// The contacts of a block that are found lane by lane.
#[derive(Clone, Debug)]
pub(crate) struct ByLane {
    /// Slots that contacts of each body fit, and those of contacts between bodies.
    pub slots_of_body: Vec<Vec<usize>>,
    pub of_pairs: Vec<usize>,
    pub asked: Vec<Asked>,
    pub found: Vec<Found>,
    /// Lanes of each slot with such a contact, and where it is among them.
    pub given: Vec<u32>,
    pub places: Vec<[u16; MAX_LANES]>,
    /// Contacts of a lane.
    pub scratch: Vec<Contact>,
    /// Where bodies can touch each other.
    pub pairs: Option<PairSearch>,
}

impl ByLane {
    /// Room for a machine whose wheels' slots end at `first_spare`.
    pub(crate) fn new(machine: &SharedMachine, first_spare: usize) -> Self {
        let bodies = machine.slot_bodies();
        let n_slots = bodies.len();
        let last_spare = first_spare + machine.spares.len();
        let in_order = (first_spare..last_spare).chain((0..first_spare).rev());
        let slots_of_body = (0..machine.n_bodies())
            .map(|body| {
                let fits = |slot: &usize| {
                    bodies[*slot].is_some_and(|body_of_slot| machine.carries(body, body_of_slot))
                };
                in_order.clone().filter(fits).collect()
            })
            .collect();
        let of_pairs = in_order.filter(|slot| bodies[*slot].is_none()).collect();
        Self {
            slots_of_body,
            of_pairs,
            asked: Vec::new(),
            found: Vec::new(),
            given: vec![0; n_slots],
            places: vec![[0; MAX_LANES]; n_slots],
            scratch: Vec::new(),
            pairs: None,
        }
    }

    /// Whether anything is to be found.
    #[inline(always)]
    pub(crate) fn is_asked(&self) -> bool {
        !self.asked.is_empty()
    }

    /// Asks for the contacts of a part in some lanes.
    #[cold]
    pub(crate) fn ask(&mut self, part: Part, lanes: u32) {
        self.asked.push(Asked { part, lanes });
    }

    /// Lanes of a slot with a contact that was found lane by lane.
    #[inline(always)]
    pub(crate) fn given(&self, slot: usize) -> u32 {
        self.given[slot]
    }

    /// The contact of a slot in a lane, if it was found lane by lane.
    #[inline(always)]
    pub(crate) fn contact(&self, slot: usize, lane: usize) -> Option<&Contact> {
        (self.given[slot] >> lane & 1 == 1)
            .then(|| &self.found[usize::from(self.places[slot][lane])].contact)
    }

    /// Contacts of a slot that were found lane by lane.
    #[inline(always)]
    fn found(&self, slot: usize) -> impl Iterator<Item = &Found> {
        let mut lanes = self.given[slot];
        std::iter::from_fn(move || {
            if lanes == 0 {
                return None;
            }
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            Some(&self.found[usize::from(self.places[slot][lane])])
        })
    }

    /// Contacts of a slot that were found lane by lane, with their lanes.
    #[inline(always)]
    pub(crate) fn contacts(&self, slot: usize) -> impl Iterator<Item = (usize, &Contact)> {
        (self.found(slot)).map(|found| (found.lane, &found.contact))
    }

    /// Contacts found lane by lane whose path is not that of their slot, with their lanes.
    #[inline(always)]
    pub(crate) fn off_path(&self, slot: usize) -> impl Iterator<Item = (usize, &Contact)> {
        (self.found(slot).filter(|found| found.is_off_path))
            .map(|found| (found.lane, &found.contact))
    }

    /// Contacts between bodies, with their lanes: the body and the other one.
    #[inline(always)]
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, [usize; 2])> {
        self.found.iter().filter_map(|found| {
            let other = found.contact.other?;
            Some((found.lane, [found.contact.body, other.body]))
        })
    }

    /// Forgets all of the last step.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.asked.clear();
        if !self.found.is_empty() {
            self.found.clear();
            self.given.fill(0);
        }
    }
}
