//! Contacts in impact, and the work of all by their law.

use super::Block;
use crate::integrator::step_contacts::STEADY;
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Block<T> {
    /// Finds the contacts in impact, as [`crate::integrator::step_contacts`] does.
    #[inline(always)]
    pub(super) fn find_impacts(&mut self) {
        let (h, _) = self.time_step();
        let slow = (h.like(2.0) * self.gravity.norm() * h).max(h.like(1e-9));
        self.has_impact = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            let active = self.contacts.slot(slot).active;
            let is_fast = active & !self.rows.u_before[slot][0].abs().le(slow);
            self.impact[slot] = is_fast;
            self.has_impact = self.has_impact | is_fast;
        }
        if (self.has_impact & self.going).any() {
            self.compare_impulses();
        }
    }

    /// Leaves those in impact whose approach the last step's impulses would not have stopped.
    #[inline(always)]
    fn compare_impulses(&mut self) {
        let zero = self.number(0.0);
        for &slot in self.contacts.used() {
            for ((change, p), last) in
                (self.pushes[slot].iter_mut().zip(&self.p[slot])).zip(&self.p_last[slot])
            {
                *change = *p - *last;
            }
        }
        self.y.fill(zero);
        self.rows
            .add_impulses(&self.contacts, self.occupied, &self.pushes, &mut self.y);
        self.rows.local(&self.contacts, &self.y, &mut self.pushes);
        self.has_impact = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            let before = self.rows.u_before[slot][0];
            let change = self.pushes[slot][0] - before;
            let is_steady = change.abs().le(zero.like(STEADY) * before.abs());
            self.impact[slot] = self.impact[slot] & !is_steady;
            self.has_impact = self.has_impact | self.impact[slot];
        }
    }

    /// Work of the contacts by their law, J, as [`crate::integrator::step_contacts`] counts it.
    #[inline(always)]
    pub(super) fn contact_work(&self) -> T {
        let (zero, half) = (self.number(0.0), self.number(0.5));
        let mut persists = self.persists & !self.has_impact;
        let (mut ends, mut changes, mut struck) = (zero, zero, zero);
        for &slot in self.contacts.used() {
            let ([p_n, p_t, p_b], [u_n, u_t, u_b]) = (self.p[slot], self.u[slot]);
            let ([_, last_t, last_b], before) = (self.p_last[slot], self.rows.u_before[slot]);
            let active = self.contacts.slot(slot).active;
            let mut end = p_t * u_t + p_b * u_b;
            if !self.yields.is_empty() {
                let law = &self.yields.laws[slot];
                let is_soft = law.is_soft() & active;
                let of_soft = law.slip_work(self.u[slot], self.p[slot]);
                let is_struck = self.impact[slot];
                end = T::select(is_soft & !is_struck, of_soft, end);
                persists = persists & !is_soft;
            }
            let change = (p_t - last_t) * before[1] + (p_b - last_b) * before[2];
            ends += T::select(active, end, zero);
            changes += T::select(active, change, zero);
            if self.impact[slot].any() {
                let both = p_n * (u_n + before[0]) + p_t * before[1] + p_b * before[2];
                struck += T::select(self.impact[slot], half * (both - end), zero);
            }
        }
        if !persists.any() {
            return ends + struck;
        }
        let mut start = zero;
        for (v, push) in self.v.iter().zip(&self.persistent) {
            start += *v * *push;
        }
        T::select(persists, half * (ends + changes + start), ends + struck)
    }
}
