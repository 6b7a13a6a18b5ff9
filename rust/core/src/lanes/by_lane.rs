//! The contacts of a block that are found lane by lane (`lane_detection`), and their part in its
//! matrices.

use nalgebra::Vector3;

use super::machine::Machine;
use crate::contact::{Contact, PairSearch, Part};
use crate::multibody::Poses;
use crate::multibody::mechanism::{BASE, Mover};
use crate::scalar::{Lane, MAX_LANES};

/// A part whose contacts are asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked<T> {
    pub part: Part,
    pub lanes: u32,
    /// Distance within which it can be in contact, m.
    pub reach: T,
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
pub(super) struct ByLane<T> {
    /// Slots that contacts of each body fit, and those of contacts between bodies.
    pub hosts: Vec<Vec<usize>>,
    pub of_pairs: Vec<usize>,
    pub asked: Vec<Asked<T>>,
    pub found: Vec<Found>,
    /// Lanes of each slot with such a contact, and where it is among them.
    pub given: Vec<u32>,
    pub places: Vec<[u16; MAX_LANES]>,
    /// Contacts of a lane.
    pub scratch: Vec<Contact>,
    /// Where bodies can touch each other.
    pub pairs: Option<PairSearch>,
}

/// Axis and swing of a velocity's motion in a lane.
#[inline]
pub(super) fn motion<T: Lane>(poses: &Poses<T>, mover: Mover, lane: usize) -> [Vector3<f64>; 2] {
    let own = &poses.motions[mover.motion];
    [own.axis.get(lane).into(), own.swing.get(lane).into()]
}

impl<T: Lane> ByLane<T> {
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

    /// Asks for the contacts of a part in some lanes; `reach`: distance within which it can be in
    /// contact, m.
    #[cold]
    pub(super) fn ask(&mut self, part: Part, lanes: u32, reach: T) {
        self.asked.push(Asked { part, lanes, reach });
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

    /// Those of a slot whose path is another one.
    #[inline(always)]
    pub(super) fn guests(&self, slot: usize) -> impl Iterator<Item = (usize, &Contact)> {
        let mut lanes = self.given[slot];
        std::iter::from_fn(move || {
            if lanes == 0 {
                return None;
            }
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            Some(&self.found[usize::from(self.places[slot][lane])])
        })
        .filter(|found| found.is_guest)
        .map(|found| (found.lane, &found.contact))
    }

    /// Lanes with contacts between bodies.
    #[inline(always)]
    pub(super) fn with_pairs(&self) -> u32 {
        (self.of_pairs.iter()).fold(0, |lanes, slot| lanes | self.given[*slot])
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

/// Calls `act` with each velocity of a joint that moves a contact, the velocity (m/s) of its point
/// per unit of it being `axis × x + swing`: of its own body with the sign 1, of the other one with
/// −1.
pub(super) fn for_each_motion<T: Lane>(
    machine: &Machine,
    poses: &Poses<T>,
    (lane, contact): (usize, &Contact),
    mut act: impl FnMut(usize, f64, Vector3<f64>, Vector3<f64>),
) {
    let other = contact.other.map(|other| (other.body, -1.0));
    for (body, sign) in std::iter::once((contact.body, 1.0)).chain(other) {
        for mover in machine.movers(body) {
            let [axis, swing] = motion(poses, *mover, lane);
            act(mover.velocity, sign, axis, swing);
        }
    }
}

/// Columns of Hᵀ of a contact along a slot's path: those of the base, then of the velocities of
/// `movers`.
pub(super) fn write_rows<T: Lane>(
    machine: &Machine,
    poses: &Poses<T>,
    (lane, contact): (usize, &Contact),
    movers: &[Mover],
    rows: &mut [[T; 3]],
) {
    let frame = contact.frame.rows();
    let x = contact.point;
    let (base, joints) = rows.split_at_mut(BASE);
    for (j, d) in frame.iter().enumerate() {
        let moment = x.cross(d);
        let whole = [d.x, d.y, d.z, moment.x, moment.y, moment.z];
        for (row, own) in base.iter_mut().zip(whole) {
            row[j].set(lane, if contact.other.is_some() { 0.0 } else { own });
        }
    }
    for row in joints.iter_mut() {
        for own in row {
            own.set(lane, 0.0);
        }
    }
    for_each_motion(
        machine,
        poses,
        (lane, contact),
        |velocity, sign, axis, swing| {
            let Some(k) = movers.iter().position(|mover| mover.velocity == velocity) else {
                return;
            };
            let moved = (axis.cross(&x) + swing) * sign;
            for (own, d) in joints[k].iter_mut().zip(&frame) {
                own.set(lane, own.get(lane) + moved.dot(d));
            }
        },
    );
}

/// Adds the generalized impulse of a contact's impulse (N s) on the velocities of joints.
pub(super) fn add_impulse<T: Lane>(
    machine: &Machine,
    poses: &Poses<T>,
    (lane, contact): (usize, &Contact),
    p: [f64; 3],
    out: &mut [T],
) {
    let [n, t, b] = contact.frame.rows();
    let force = n * p[0] + t * p[1] + b * p[2];
    let moment = contact.point.cross(&force);
    for_each_motion(
        machine,
        poses,
        (lane, contact),
        |velocity, sign, axis, swing| {
            let own = &mut out[velocity];
            let power = sign * (axis.dot(&moment) + swing.dot(&force));
            own.set(lane, own.get(lane) + power);
        },
    );
}
