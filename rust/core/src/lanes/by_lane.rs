//! The contacts of a block that are found lane by lane (`lane_detection`).

use nalgebra::{Matrix3, Vector3};

use super::machine::Machine;
use crate::contact::body_motion::BodyMotion;
use crate::contact::{Contact, PairSearch, Part};
use crate::multibody::Motion;
use crate::multibody::Poses;
use crate::multibody::mechanism::Mechanism;
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// A lane of a block.
#[derive(Clone, Copy)]
pub(super) struct OneLane<'a, T: Lane> {
    pub machine: &'a Machine,
    pub poses: &'a Poses<T>,
    pub v: &'a [T],
    pub lane: usize,
}

impl<T: Lane> BodyMotion for OneLane<'_, T> {
    #[inline]
    fn mechanism(&self) -> &Mechanism {
        self.machine
    }

    #[inline]
    fn origin(&self, body: usize) -> Vector3<f64> {
        let tree = self.machine.tree_of_body(body);
        self.poses.origin_of(tree).get(self.lane).into()
    }

    #[inline]
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        let own = &self.poses.bodies[body];
        let columns = own.R.columns().map(|x| Vector3::from(x.get(self.lane)));
        (Matrix3::from_columns(&columns), own.r.get(self.lane).into())
    }

    #[inline]
    fn motion(&self, motion: usize) -> Motion<f64> {
        let own = &self.poses.motions[motion];
        let vector = |x: Vec3<T>| Vec3::from(Vector3::from(x.get(self.lane)));
        Motion {
            axis: vector(own.axis),
            swing: vector(own.swing),
        }
    }

    #[inline]
    fn velocity(&self, k: usize) -> f64 {
        self.v[k].get(self.lane)
    }
}

/// A part whose contacts are asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub part: Part,
    pub lanes: u32,
}

/// A contact of a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub lane: usize,
    pub contact: Contact,
    /// Whether the path of its slot is not its body's.
    pub is_guest: bool,
}

/// The contacts of a block that are found lane by lane.
#[derive(Clone, Debug)]
pub(super) struct ByLane {
    /// Slots that contacts of each body fit, and those of contacts between bodies.
    pub hosts: Vec<Vec<usize>>,
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
    pub(super) fn new(machine: &Machine, first_spare: usize) -> Self {
        let bodies = machine.slot_bodies();
        let n_slots = bodies.len();
        let last_spare = first_spare + machine.spares.len();
        let in_order = (first_spare..last_spare).chain((0..first_spare).rev());
        let hosts = (0..machine.n_bodies())
            .map(|body| {
                let fits =
                    |slot: &usize| bodies[*slot].is_some_and(|host| machine.carries(body, host));
                in_order.clone().filter(fits).collect()
            })
            .collect();
        let of_pairs = in_order.filter(|slot| bodies[*slot].is_none()).collect();
        Self {
            hosts,
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
    pub(super) fn is_asked(&self) -> bool {
        !self.asked.is_empty()
    }

    /// Asks for the contacts of a part in some lanes.
    #[cold]
    pub(super) fn ask(&mut self, part: Part, lanes: u32) {
        self.asked.push(Asked { part, lanes });
    }

    /// Lanes of a slot with a contact that was found lane by lane.
    #[inline(always)]
    pub(super) fn given(&self, slot: usize) -> u32 {
        self.given[slot]
    }

    /// The contact of a slot in a lane, if it was found lane by lane.
    #[inline(always)]
    pub(super) fn contact(&self, slot: usize, lane: usize) -> Option<&Contact> {
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
    pub(super) fn contacts(&self, slot: usize) -> impl Iterator<Item = (usize, &Contact)> {
        (self.found(slot)).map(|found| (found.lane, &found.contact))
    }

    /// Contacts found lane by lane whose path is not that of their slot, with their lanes.
    #[inline(always)]
    pub(super) fn guests(&self, slot: usize) -> impl Iterator<Item = (usize, &Contact)> {
        (self.found(slot).filter(|found| found.is_guest)).map(|found| (found.lane, &found.contact))
    }

    /// Contacts between bodies, with their lanes: the body and the other one.
    #[inline(always)]
    pub(super) fn pairs(&self) -> impl Iterator<Item = (usize, [usize; 2])> {
        self.found.iter().filter_map(|found| {
            let other = found.contact.other?;
            Some((found.lane, [found.contact.body, other.body]))
        })
    }

    /// Forgets all of the last step.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.asked.clear();
        if !self.found.is_empty() {
            self.found.clear();
            self.given.fill(0);
        }
    }
}
