//! Wheels that yield where they touch: the contacts' laws of [`crate::law::compliance`], by slot.
//!
//! The law of a contact is a few operations on what the step knows already; it is evaluated lane by
//! lane with the same code as elsewhere.

use super::contacts::Contacts;
use super::machine::Machine;
use super::problem::{ContactProblem, Triple};
use crate::contact::Part;
use crate::law::compliance::{Compliance, Yielding};
use crate::scalar::{Lane, LaneMask, MAX_LANES};

/// The laws of a block's contacts. Empty where all wheels are rigid.
#[derive(Clone, Debug)]
pub struct Yields<T: Lane> {
    token: T::Token,
    laws: Vec<[Yielding; MAX_LANES]>,
    /// Terms on the diagonal of W, 1/kg.
    pub diagonal: Vec<T>,
    /// Shifts of the free velocities, m/s.
    pub shift: Vec<Triple<T>>,
    /// Penetration that no elastic force explains, m.
    pub unexplained: Vec<T>,
}

impl<T: Lane> Yields<T> {
    /// Room for a machine with `n_slots` slots.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine, n_slots: usize) -> Self {
        let n = if machine.yields() { n_slots } else { 0 };
        let zero = T::splat(token, 0.0);
        Self {
            token,
            laws: vec![[Yielding::default(); MAX_LANES]; n],
            diagonal: vec![zero; n],
            shift: vec![[zero; 3]; n],
            unexplained: vec![zero; n],
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
    /// `u_before`: local velocities before the step by slot, m/s. `problems`: one a lane, with the
    /// impulses of the last step. In a lane without a last step, `unknown` replaces the normal
    /// impulse, N s.
    pub fn update(
        &mut self,
        machine: &Machine,
        contacts: &Contacts<T>,
        u_before: &[Triple<T>],
        step: (f64, f64),
        problems: &[ContactProblem],
        unknown: impl Fn(usize) -> Option<f64>,
    ) {
        for &slot in contacts.used() {
            let of_wheel = |w: usize| machine.wheels.get(w).and_then(|wheel| wheel.compliance);
            let compliance = |lane| match contacts.by_lane.contact(slot, lane) {
                None => of_wheel(contacts.part(slot)), // None for a stop
                Some(contact) => {
                    let of = |part| match part {
                        Part::Wheel(w) => of_wheel(w),
                        _ => None,
                    };
                    let other = contact.other.and_then(|other| of(other.part));
                    Compliance::in_series(of(contact.part), other)
                }
            };
            let (own, places) = (contacts.slot(slot), contacts.places(slot));
            let mut columns = [[0.0; MAX_LANES]; 5];
            for (lane, problem) in problems[..T::LANES].iter().enumerate() {
                let law = compliance(lane)
                    .filter(|_| own.active.get(lane))
                    .map(|compliance| {
                        let (gap, u_N) = (own.gap.get(lane), u_before[slot][0].get(lane));
                        let p = &problem.p[3 * usize::from(places[lane])..];
                        let before = match unknown(lane) {
                            Some(p) => [p, 0.0, 0.0],
                            None => [p[0], p[1], p[2]],
                        };
                        compliance.over(step, gap, u_N, before)
                    });
                let law = law.unwrap_or_default();
                let [n, t, b] = law.shift;
                let numbers = [law.diagonal, n, t, b, law.unexplained];
                for (column, number) in columns.iter_mut().zip(numbers) {
                    column[lane] = number;
                }
                self.laws[slot][lane] = law;
            }
            let [diagonal, n, t, b, unexplained] =
                columns.map(|column| T::load(self.token, &column[..T::LANES]));
            self.diagonal[slot] = diagonal;
            self.shift[slot] = [n, t, b];
            self.unexplained[slot] = unexplained;
        }
    }

    /// Adds the shifts to free velocities by slot, m/s.
    #[inline(always)]
    pub fn shift(&self, contacts: &Contacts<T>, q: &mut [Triple<T>]) {
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            for (q, shift) in q[slot].iter_mut().zip(self.shift[slot]) {
                *q += shift;
            }
        }
    }

    /// Takes shifts and what the contacts yield under the impulses `p` out of the answer's
    /// velocities `u`, by slot.
    #[inline(always)]
    pub fn unshift(&self, contacts: &Contacts<T>, p: &[Triple<T>], u: &mut [Triple<T>]) {
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            let own = (u[slot].iter_mut().zip(p[slot])).zip(self.shift[slot]);
            for ((u, p), shift) in own {
                *u -= shift + self.diagonal[slot] * p;
            }
        }
    }

    /// Energy that the contacts give off in a step of `h`, J; see
    /// [`crate::integrator::energy_audit`].
    #[must_use]
    pub fn supplied(
        &self,
        contacts: &Contacts<T>,
        h: f64,
        p: &[Triple<T>],
        u: &[Triple<T>],
        u_before: &[Triple<T>],
    ) -> T {
        let mut sums = [0.0; MAX_LANES];
        for &slot in contacts.used().iter().filter(|_| !self.is_empty()) {
            let laws = self.laws[slot][..T::LANES].iter().enumerate();
            for (lane, law) in laws.filter(|(_, law)| law.diagonal > 0.0) {
                let p = p[slot].map(|p| p.get(lane));
                let (u_N, before) = (u[slot][0].get(lane), u_before[slot][0].get(lane));
                sums[lane] += law.supplied(h, [before, u_N], p);
            }
        }
        T::load(self.token, &sums[..T::LANES])
    }
}
