//! Wheels that yield where they touch: the contacts' laws of [`crate::law::compliance`], by slot.

use super::contacts::Contacts;
use super::machine::Machine;
use super::problem::Triple;
use crate::contact::{Contact, Part};
use crate::law::compliance::{Compliance, Yielding};
use crate::scalar::{Lane, LaneMask};

/// The laws of a block's contacts. Empty where all wheels are rigid.
#[derive(Clone, Debug)]
pub struct Yields<T: Lane> {
    zero: T,
    /// Of each slot.
    pub laws: Vec<Yielding<T>>,
}

impl<T: Lane> Yields<T> {
    /// Room for a machine with `n_slots` slots.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine, n_slots: usize) -> Self {
        let n = if machine.yields() { n_slots } else { 0 };
        let zero = T::splat(token, 0.0);
        Self {
            zero,
            laws: vec![Yielding::none(zero); n],
        }
    }

    /// Whether all wheels are rigid.
    #[inline(always)]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }

    /// The laws over a `step`: its length (s) and the scheme's θ.
    ///
    /// `u_before`: local velocities before the step by slot, m/s. `last`: impulses of the last step
    /// by slot, N s; in the lanes of a slot's mask `unknown`, without a last step, its number
    /// replaces the normal one.
    #[inline(always)]
    pub fn update(
        &mut self,
        machine: &Machine,
        contacts: &Contacts<T>,
        step: (T, T),
        u_before: &[Triple<T>],
        last: &[Triple<T>],
        unknown: impl Fn(usize) -> (T::Mask, T),
    ) {
        let zero = self.zero;
        for &slot in contacts.used() {
            let (spring, is_soft) = self.spring(machine, contacts, slot);
            if !is_soft.any() {
                self.laws[slot] = Yielding::none(zero);
                continue;
            }
            let [n, t, b] = last[slot];
            let (no_memory, p) = unknown(slot);
            let before = [
                T::select(no_memory, p, n),
                T::select(no_memory, zero, t),
                T::select(no_memory, zero, b),
            ];
            let law = spring.over(step, contacts.slot(slot).gap, u_before[slot][0], before);
            self.laws[slot] = law.only(is_soft);
        }
    }

    /// Spring and damper of a slot, and the lanes that have one.
    #[inline(always)]
    fn spring(
        &self,
        machine: &Machine,
        contacts: &Contacts<T>,
        slot: usize,
    ) -> (Compliance<T>, T::Mask) {
        let (zero, active) = (self.zero, contacts.slot(slot).active);
        let (mut spring, mut is_soft) = (
            Compliance {
                stiffness: zero,
                damping: zero,
            },
            active & !active,
        );
        let own = machine.wheels.get(contacts.part(slot)); // none of a stop or a spare slot
        if let Some(own) = own.and_then(|wheel| wheel.compliance) {
            (spring.stiffness, spring.damping) = (zero.like(own.stiffness), zero.like(own.damping));
            is_soft = active;
        }
        for (lane, contact) in contacts.by_lane.contacts(slot) {
            let here = T::mask(zero.token(), 1 << lane);
            is_soft = is_soft & !here;
            if let Some(own) = of_contact(machine, contact) {
                is_soft = is_soft | (here & active);
                spring.stiffness.set(lane, own.stiffness);
                spring.damping.set(lane, own.damping);
            }
        }
        (spring, is_soft)
    }

    /// Adds the shifts to free velocities by slot, m/s.
    #[inline(always)]
    pub fn shift(&self, contacts: &Contacts<T>, q: &mut [Triple<T>]) {
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            for (q, shift) in q[slot].iter_mut().zip(self.laws[slot].shift) {
                *q += shift;
            }
        }
    }

    /// Takes shifts and what the contacts yield under the impulses `p` out of the answer's
    /// velocities `u`, by slot.
    #[inline(always)]
    pub fn unshift(&self, contacts: &Contacts<T>, p: &[Triple<T>], u: &mut [Triple<T>]) {
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            let law = &self.laws[slot];
            for ((u, p), shift) in u[slot].iter_mut().zip(p[slot]).zip(law.shift) {
                *u -= shift + law.diagonal * p;
            }
        }
    }

    /// Energy that the contacts of each cluster give off in a step of `h`, J, added to `out`; see
    /// [`crate::integrator::energy_audit`].
    #[inline(always)]
    pub fn supplied(
        &self,
        contacts: &Contacts<T>,
        h: T,
        p: &[Triple<T>],
        u: &[Triple<T>],
        u_before: &[Triple<T>],
        out: &mut [T],
    ) {
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            let law = &self.laws[slot];
            let given = law.supplied(h, [u_before[slot][0], u[slot][0]], p[slot]);
            let given = T::select(self.zero.lt(law.diagonal), given, self.zero);
            contacts.add(slot, given, out);
        }
    }
}

/// Spring and damper of a contact that was found lane by lane.
fn of_contact(machine: &Machine, contact: &Contact) -> Option<Compliance> {
    let of = |part| match part {
        Part::Wheel(w) => machine.wheels[w].compliance,
        _ => None,
    };
    let other = contact.other.and_then(|other| of(other.part));
    Compliance::in_series(of(contact.part), other)
}
