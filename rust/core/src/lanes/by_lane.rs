//! Contacts that are found lane by lane, as the general step finds them ([`crate::contact`]): those
//! of boxes and balls, of bodies with each other, and of wheels that touch more than a plane or a
//! few spheres. They take free slots whose path of velocities begins with their body's.

use nalgebra::{Matrix3, Vector3};

use super::contacts::{Contacts, Sight};
use super::ground::Ground;
use super::machine::{Machine, Mover};
use super::poses::Poses;
use crate::contact::detection::{Moving, detect_parts};
use crate::contact::pair_detection::detect_pairs_of;
use crate::contact::relocation::relocate_to;
use crate::contact::stance::Stance;
use crate::contact::{Activation, Contact, PairSearch, Part};
use crate::multibody::model::BASE;
use crate::scalar::{Lane, LaneMask, MAX_LANES};

/// A part whose contacts are asked for.
#[derive(Clone, Copy, Debug)]
struct Asked<T> {
    part: Part,
    lanes: u32,
    /// Distance within which it can be in contact, m.
    reach: T,
}

/// A contact of a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub lane: usize,
    pub contact: Contact,
    /// Whether the path of its slot is not its body's.
    is_guest: bool,
}

/// The contacts of a block that are found lane by lane.
#[derive(Clone, Debug)]
pub(super) struct ByLane<T> {
    /// Slots that contacts of each body fit, and those of contacts between bodies.
    hosts: Vec<Vec<usize>>,
    of_pairs: Vec<usize>,
    asked: Vec<Asked<T>>,
    found: Vec<Found>,
    /// Lanes of each slot with such a contact, and where it is among them.
    given: Vec<u32>,
    places: Vec<[u16; MAX_LANES]>,
    /// Contacts of a lane.
    scratch: Vec<Contact>,
    /// Where bodies can touch each other.
    pairs: Option<PairSearch>,
}

/// A lane of a block.
struct OneLane<'a, T: Lane> {
    machine: &'a Machine,
    poses: &'a Poses<T>,
    v: &'a [T],
    lane: usize,
}

impl<T: Lane> Stance for OneLane<'_, T> {
    #[inline]
    fn origin(&self, _: usize) -> Vector3<f64> {
        self.poses.origin.get(self.lane).into()
    }

    #[inline]
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        let own = &self.poses.bodies[body];
        let columns = [own.R.x, own.R.y, own.R.z].map(|x| Vector3::from(x.get(self.lane)));
        (Matrix3::from_columns(&columns), own.r.get(self.lane).into())
    }

    #[inline]
    fn point_velocity(&self, body: usize, x: &Vector3<f64>) -> Vector3<f64> {
        let v = |k: usize| self.v[k].get(self.lane);
        let turning = Vector3::new(v(3), v(4), v(5));
        let mut velocity = Vector3::new(v(0), v(1), v(2)) + turning.cross(x);
        for mover in self.machine.movers(body) {
            let [axis, swing] = motion(self.poses, *mover, self.lane);
            velocity += (axis.cross(x) + swing) * v(mover.velocity);
        }
        velocity
    }
}

/// Axis and swing of a velocity's motion in a lane.
#[inline]
fn motion<T: Lane>(poses: &Poses<T>, mover: Mover, lane: usize) -> [Vector3<f64>; 2] {
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

impl<T: Lane> Contacts<T> {
    /// Finds what was asked for. Returns the lanes with unknown ground or too few slots.
    #[cold]
    pub(super) fn find_by_lane(&mut self, ground: &Ground<T>, sight: &Sight<'_, T>) -> T::Mask {
        let mut declined = 0;
        for lane in 0..T::LANES {
            let (Some(model), Some(terrain)) = (&sight.models[lane], ground.terrain(lane)) else {
                continue;
            };
            let at = |poses| OneLane {
                machine: sight.machine,
                poses,
                v: sight.v,
                lane,
            };
            let (middle, end) = (at(sight.middle), at(sight.end));
            let machine = Moving {
                model: &**model,
                middle: &middle,
                end: &end,
            };
            let mut contacts = std::mem::take(&mut self.by_lane.scratch);
            contacts.clear();
            let activation = |margin| Activation {
                lead: sight.forecast.lead,
                hover: sight.forecast.hover.get(lane),
                slow: sight.forecast.slow.get(lane),
                margin,
            };
            let own = |asked: &&Asked<T>| asked.lanes >> lane & 1 == 1;
            for asked in self.by_lane.asked.iter().filter(own) {
                let activation = activation(asked.reach.get(lane));
                let parts = std::iter::once(asked.part);
                let unknown = detect_parts(parts, &machine, &**terrain, &activation, &mut contacts);
                declined |= u32::from(unknown.is_some()) << lane;
            }
            if sight.machine.has_pairs && sight.going >> lane & 1 == 1 {
                let v: Vec<f64> = sight.v.iter().map(|v| v.get(lane)).collect();
                let places = |body: usize| sight.middle.bodies[body].r.get(lane).into();
                let fastest = model.fastest_point(&model.trees()[0], places, &v);
                let activation = activation(sight.forecast.lead.abs() * fastest);
                let pairs = self
                    .by_lane
                    .pairs
                    .get_or_insert_with(|| PairSearch::new(model));
                detect_pairs_of(model, &middle, &activation, pairs, &mut contacts);
            }
            for contact in &mut contacts {
                relocate_to(model, &end, &**terrain, contact);
                declined |= u32::from(!self.give(sight.machine, lane, contact)) << lane;
                if declined != 0 {
                    eprintln!("DECLINED giving {contact:?}");
                }
            }
            self.by_lane.scratch = contacts;
        }
        T::mask(self.token, declined)
    }

    /// Enters a contact into a free slot. False if none is.
    fn give(&mut self, machine: &Machine, lane: usize, contact: &Contact) -> bool {
        let Self {
            parts,
            slots,
            part_of,
            by_lane,
            token,
            ..
        } = self;
        let own = match contact.part {
            Part::Wheel(w) if contact.other.is_none() => parts.wheels[w].slots.clone(),
            _ => 0..0,
        };
        let hosts = match contact.other {
            None => &by_lane.hosts[contact.body],
            Some(_) => &by_lane.of_pairs,
        };
        let mut hosts = own.chain(hosts.iter().copied());
        let Some(slot) = hosts.find(|&slot| !slots[slot].active.get(lane)) else {
            return false;
        };
        let Ok(place) = u16::try_from(by_lane.found.len()) else {
            return false;
        };
        let is_own = |w: usize| {
            machine
                .wheels
                .get(w)
                .is_some_and(|w| w.body == contact.body)
        };
        by_lane.found.push(Found {
            lane,
            contact: *contact,
            is_guest: contact.other.is_some() || !is_own(part_of[slot]),
        });
        by_lane.given[slot] |= 1 << lane;
        by_lane.places[slot][lane] = place;
        let slot = &mut slots[slot];
        slot.active = slot.active | T::mask(*token, 1 << lane);
        let [n, t, b] = contact.frame.rows().map(<[f64; 3]>::from);
        for (own, x) in [
            (&mut slot.point, contact.point.into()),
            (&mut slot.n, n),
            (&mut slot.t, t),
            (&mut slot.b, b),
        ] {
            own.set(lane, x);
        }
        slot.gap.set(lane, contact.gap);
        true
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
