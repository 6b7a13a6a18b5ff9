//! Newton's impact law in a block: [`crate::law::newton_impact`].

use super::Block;
use super::balance::Correction;
use crate::scalar::{Lane, LaneMask};
use crate::solver::batch::problem::ContactProblem;

impl<T: Lane> Block<T> {
    /// Lets contacts that close bounce by Newton's law in that step although their wheels yield,
    /// see `crate::integrator::step_contacts`.
    pub(super) fn bounce_off_treads(&mut self) {
        if self.yields.is_empty() || !self.options.is_elastic() {
            return;
        }
        let zero = self.number(0.0);
        for &slot in self.contacts.used() {
            let law = &mut self.yields.laws[slot];
            let is_new = self.p_last[slot][0].abs().le(zero);
            let bounces = law.is_soft() & is_new & zero.lt(self.restitution[slot]);
            self.bounces[slot] = bounces;
            *law = law.only(!bounces);
        }
    }

    /// Adds `e u_N⁻`, times a sign, to the normal velocities of the rigid contacts.
    #[inline(always)]
    pub(super) fn rebound(&mut self, sign: T) {
        if !self.options.is_elastic() {
            return;
        }
        let zero = sign.like(0.0);
        for &slot in self.contacts.used() {
            let mut shift = sign * (self.restitution[slot] * self.rows.u_before[slot][0]);
            if !self.yields.is_empty() {
                shift = T::select(self.yields.laws[slot].is_soft(), zero, shift);
            }
            self.u[slot][0] += shift;
        }
    }

    /// Forgets the impulses of contacts that bounced although their wheels yield: they say nothing
    /// of a deflection.
    pub(super) fn forget_bounces(&mut self) {
        if self.yields.is_empty() || !self.options.is_elastic() {
            return;
        }
        for &slot in self.contacts.used() {
            let bounced = self.bounces[slot] & self.contacts.slot(slot).active;
            for lane in (0..T::LANES).filter(|&lane| bounced.get(lane)) {
                // Pieces of a surface share a key, so the contact is found by its place.
                let home = usize::from(self.contacts.homes(slot)[lane]);
                let lists = self
                    .contacts
                    .problems_of(lane)
                    .take_while(|own| *own < home);
                let before: usize = lists.map(|own| self.contacts.list(own).n).sum();
                let place = before + usize::from(self.contacts.places(slot)[lane]);
                self.next_memories[lane].impulses[place].1 = [0.0; 3];
            }
        }
    }

    /// Enters in the reports how far the corrections of the velocity violate the law of
    /// restitution: a closed contact that is to rebound at u_N separates at a share of it. See
    /// `crate::integrator::energy_audit`.
    pub(super) fn note_violations(
        &mut self,
        problems: &[ContactProblem],
        corrections: &[Correction<T>],
    ) {
        if !self.options.is_elastic() {
            return;
        }
        for (index, problem) in problems[..self.n_problems()].iter().enumerate() {
            let (lane, own) = (Self::lane_of(index), &corrections[index / T::LANES]);
            let list = self.contacts.list(index);
            if !own.lanes.get(lane) || list.n == 0 {
                continue;
            }
            let mut lost = 0.0;
            for (place, slot) in list.slots[..list.n].iter().enumerate() {
                if problem.p[3 * place] > 0.0 {
                    let u_N = self.u[usize::from(*slot)][0].get(lane);
                    lost += u_N * u_N;
                }
            }
            let free: f64 = problem.q[..3 * list.n].iter().map(|q| q * q).sum();
            let share = own.share.get(lane);
            let violation = (1.0 - share) * f64::sqrt(lost);
            let report = &mut self.reports[lane];
            if violation > 0.0 {
                let size = f64::sqrt(free).max(f64::MIN_POSITIVE);
                report.residual = report.residual.max(violation / size);
            }
        }
    }
}
