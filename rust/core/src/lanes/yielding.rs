//! Wheels that yield where they touch: the contacts' laws of [`crate::law::compliance`], by slot.

use super::contacts::Contacts;
use super::machine::Machine;
use crate::contact::Part;
use crate::law::compliance::{Compliance, Yielding};
use crate::multibody::Poses;
use crate::scalar::{Lane, LaneMask};
use crate::solver::batch::problem::Triple;

/// The laws of a block's contacts. Empty where all wheels are rigid.
#[derive(Clone, Debug)]
pub struct Yields<T: Lane> {
    zero: T,
    /// Law of each slot's contact.
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
    /// `motion`: poses at the midpoint, and the velocity (nv). `u_before`: local velocities before
    /// the step by slot, m/s. `last`: impulses of the last step by slot, N s. `unknown`: of a slot,
    /// lanes without a last step and the normal impulse there, as [`Compliance::over`] takes them.
    #[inline(always)]
    pub fn update(
        &mut self,
        (machine, contacts): (&Machine, &Contacts<T>),
        motion: (&Poses<T>, &[T]),
        step: (T, T),
        u_before: &[Triple<T>],
        last: &[Triple<T>],
        unknown: impl Fn(usize) -> (T::Mask, T),
    ) {
        for &slot in contacts.used() {
            let (spring, is_soft) = self.spring((machine, contacts), motion, slot);
            self.laws[slot] = match spring {
                Some(spring) if is_soft.any() => {
                    let (gap, u_N) = (contacts.slot(slot).gap, u_before[slot][0]);
                    (spring.over(step, gap, u_N, last[slot], unknown(slot))).only(is_soft)
                }
                _ => Yielding::none(self.zero),
            };
        }
    }

    /// Springs and damper of a slot, and the lanes that have them.
    #[inline(always)]
    fn spring(
        &self,
        (machine, contacts): (&Machine, &Contacts<T>),
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
            let here = T::mask(self.zero.token(), 1 << lane);
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
            let more = self.laws[slot].yielded(p[slot]);
            for (u, more) in u[slot].iter_mut().zip(more) {
                *u -= more;
            }
        }
    }

    /// What the contacts of each cluster hold over a `step`, its length (s) and the scheme's θ,
    /// added to `out`, J; see [`crate::integrator::energy_audit`].
    #[inline(always)]
    pub fn held(
        &self,
        contacts: &Contacts<T>,
        step: (T, T),
        p: &[Triple<T>],
        [u_before, u]: [&[Triple<T>]; 2],
        out: [&mut [T]; 3],
    ) {
        let [before, most, given] = out;
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            let law = &self.laws[slot];
            let own = law.held(step, [u_before[slot], u[slot]], p[slot]);
            let only = |x: T| T::select(law.is_soft(), x, self.zero);
            contacts.add(slot, only(own.before), before);
            contacts.add(slot, only(own.most), most);
            contacts.add(slot, only(own.given), given);
        }
    }
}
