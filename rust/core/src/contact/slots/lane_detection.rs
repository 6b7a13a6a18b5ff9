//! Contacts that are found lane by lane, as those of one machine ([`crate::contact`]): those
//! of boxes and balls, of bodies with each other, and of wheels that touch more than a plane or a
//! few spheres. They take free slots whose path of velocities begins with their body's.

use super::by_lane::{Asked, Found};
use super::contacts::{ContactSlots, DetectionInput};
use super::ground::BlockGround;
use super::machine::SharedMachine;
use crate::contact::body_motion::Still;
use crate::contact::detection::{MovingMachine, detect_parts};
use crate::contact::pair_detection::detect_pairs_of;
use crate::contact::relocation::relocate_to;
use crate::contact::{Contact, PairSearch, Part};
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> ContactSlots<T> {
    /// Finds what was asked for, and contacts between bodies in the lanes `meeting`. Returns the
    /// lanes with unknown ground or too few slots.
    #[cold]
    pub(crate) fn find_by_lane(
        &mut self,
        ground: &BlockGround<T>,
        input: &DetectionInput<'_, T>,
        meeting: u32,
    ) -> T::Mask {
        let mut fallbacks = 0;
        for lane in 0..T::LANES {
            let (Some(model), Some(terrain)) = (&input.models[lane], ground.terrain(lane)) else {
                continue;
            };
            let at = |poses| Still {
                mechanism: input.machine.mechanism(),
                poses,
                v: input.v,
                lane,
            };
            let (middle, end) = (at(input.middle), at(input.end));
            let machine = MovingMachine {
                model,
                middle: &middle,
                end: &end,
            };
            let mut contacts = std::mem::take(&mut self.by_lane.scratch);
            contacts.clear();
            let activation = input.activation.of_lane(lane);
            let own = |asked: &&Asked| asked.lanes >> lane & 1 == 1;
            for asked in self.by_lane.asked.iter().filter(own) {
                let parts = std::iter::once(asked.part);
                let near = &**ground.near(asked.part, lane).unwrap_or(terrain);
                let unknown = detect_parts(parts, &machine, near, &activation, &mut contacts);
                fallbacks |= u32::from(unknown.is_some()) << lane;
            }
            if meeting >> lane & 1 == 1 {
                let pairs = self
                    .by_lane
                    .pairs
                    .get_or_insert_with(|| PairSearch::new(model));
                detect_pairs_of(model, &middle, &activation, pairs, &mut contacts);
            }
            for contact in &mut contacts {
                relocate_to(model, &end, &**terrain, contact);
                fallbacks |= u32::from(!self.give(input.machine, lane, contact)) << lane;
            }
            self.by_lane.scratch = contacts;
        }
        T::mask(self.token, fallbacks)
    }

    /// Enters a contact into a free slot. False if none is.
    fn give(&mut self, machine: &SharedMachine, lane: usize, contact: &Contact) -> bool {
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
        let slots_of_body = match contact.other {
            None => &by_lane.slots_of_body[contact.body],
            Some(_) => &by_lane.of_pairs,
        };
        let mut slots_of_body = own.chain(slots_of_body.iter().copied());
        let Some(slot) = slots_of_body.find(|&slot| !slots[slot].active.get(lane)) else {
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
            is_off_path: contact.other.is_some() || !is_own(part_of[slot]),
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
