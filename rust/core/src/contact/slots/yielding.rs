//! Wheels that yield where they touch, by slot: [`crate::law::compliance`].

use super::contacts::ContactSlots;
use super::machine::SharedMachine;
use crate::contact::Part;
use crate::law::compliance::Compliance;
use crate::multibody::Poses;
use crate::scalar::Lane;

/// Springs and damper of a slot, and the lanes that have them.
#[inline(always)]
pub(crate) fn spring<T: Lane>(
    (machine, contacts): (&SharedMachine, &ContactSlots<T>),
    (poses, v): (&Poses<T>, &[T]),
    slot: usize,
) -> (Option<Compliance<T>>, T::Mask) {
    let active = contacts.slot(slot).active;
    let mut is_soft = active & !active;
    let of = |w: usize| {
        let wheel = machine.wheels.get(w)?; // none of a stop or a spare slot
        let tread = wheel.tread?;
        let parts = (wheel.body, wheel.axle, wheel.radius);
        let n = contacts.slot(slot).n;
        Some(tread.rolling(poses.rolling(machine, parts, n, |k| v[k])))
    };
    let mut spring = of(contacts.part(slot));
    if spring.is_some() {
        is_soft = active;
    }
    for (lane, contact) in contacts.by_lane.contacts(slot) {
        let here = T::mask(contacts.token, 1 << lane);
        is_soft = is_soft & !here;
        let of = |part| match part {
            Part::Wheel(w) => of(w),
            _ => None,
        };
        let other = contact.other.and_then(|other| of(other.part));
        if let Some(own) = Compliance::in_series(of(contact.part), other) {
            is_soft = is_soft | (here & active);
            spring = Some(spring.map_or(own, |spring| spring.or(here, &own)));
        }
    }
    (spring, is_soft)
}
