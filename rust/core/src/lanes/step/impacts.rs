//! Contacts in impact, and the work of all by their law.

use super::Block;
use crate::integrator::step_contacts::STEADY;
use crate::law::newton_impact::slow_approach;
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Block<T> {
    /// Finds the contacts in impact, as [`crate::integrator::step_contacts`] does.
    #[inline(always)]
    pub(super) fn find_impacts(&mut self) {
        let (h, _) = self.time_step();
        let slow = slow_approach(self.gravity.norm(), h);
        self.has_impact.fill(T::mask(self.token, 0));
        for &slot in self.contacts.used() {
            let active = self.contacts.slot(slot).active;
            let mut speed = self.rows.u_before[slot][0].abs();
            if let Some(lever) = self.lever(slot) {
                speed *= lever;
            }
            let is_fast = active & !speed.le(slow);
            self.impact[slot] = is_fast;
            self.contacts.mark(slot, is_fast, &mut self.has_impact);
        }
        if (self.any(&self.has_impact) & self.going).any() {
            self.compare_impulses();
        }
        self.contacts.unite(&mut self.has_impact);
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
        self.has_impact.fill(T::mask(self.token, 0));
        for &slot in self.contacts.used() {
            let before = self.rows.u_before[slot][0];
            let change = self.pushes[slot][0] - before;
            let is_steady = change.abs().le(zero.like(STEADY) * before.abs());
            self.impact[slot] = self.impact[slot] & !is_steady;
            (self.contacts).mark(slot, self.impact[slot], &mut self.has_impact);
        }
    }

    /// Work of the contacts of each group by their law, J, as
    /// [`crate::integrator::step_contacts`] counts it.
    #[inline(always)]
    pub(super) fn weigh_contacts(&mut self) {
        let half = self.number(0.5);
        let mut sums = std::mem::take(&mut self.energies.of_contacts);
        for sum in &mut sums {
            sum.fill(half.like(0.0));
        }
        let mut is_rough = std::mem::take(&mut self.energies.in_touch);
        is_rough.fill(T::mask(self.token, 0));
        let [ends, changes, struck, start] = &mut sums;
        for &slot in self.contacts.used() {
            let ([p_n, p_t, p_b], [u_n, u_t, u_b]) = (self.p[slot], self.u[slot]);
            let ([_, last_t, last_b], before) = (self.p_last[slot], self.rows.u_before[slot]);
            let (zero, active) = (half.like(0.0), self.contacts.slot(slot).active);
            let mut end = p_t * u_t + p_b * u_b;
            if !self.yields.is_empty() {
                let law = &self.yields.laws[slot];
                let yields = law.is_soft() & active;
                let of_soft = law.slip_work(self.u[slot], self.p[slot]);
                end = T::select(yields & !self.impact[slot], of_soft, end);
                self.contacts.mark(slot, yields, &mut is_rough);
            }
            let change = (p_t - last_t) * before[1] + (p_b - last_b) * before[2];
            let contacts = &self.contacts;
            contacts.add(slot, T::select(active, end, zero), ends);
            contacts.add(slot, T::select(active, change, zero), changes);
            if self.impact[slot].any() {
                let both = p_n * (u_n + before[0]) + p_t * before[1] + p_b * before[2];
                let work = T::select(self.impact[slot], half * (both - end), zero);
                contacts.add(slot, work, struck);
            }
        }
        for (own, has_impact) in is_rough.iter_mut().zip(&self.has_impact) {
            *own = *own | *has_impact;
        }
        self.contacts.unite(&mut is_rough);
        let persists = self.persists.iter().zip(&is_rough);
        let is_any = persists.fold(false, |any, (own, rough)| any | (*own & !*rough).any());
        if is_any {
            let pushes = self.persistent.iter().zip(&self.cluster_of);
            for (v, (push, cluster)) in self.v.iter().zip(pushes) {
                start[*cluster] += *v * *push;
            }
            self.contacts.gather(start);
        }
        for sum in [&mut *ends, &mut *changes, &mut *struck] {
            self.contacts.gather(sum);
        }
        for (c, balance) in self.balances.iter_mut().enumerate() {
            balance.contact_work = ends[c] + struck[c];
            if is_any {
                let persists = self.persists[c] & !is_rough[c];
                let work = half * (ends[c] + changes[c] + start[c]);
                balance.contact_work = T::select(persists, work, balance.contact_work);
            }
        }
        (self.energies.of_contacts, self.energies.in_touch) = (sums, is_rough);
    }
}
