//! The position projection: contacts that penetrate too deep are moved apart.

use std::sync::Arc;

use super::balance::select_both;
use super::{Block, Fallback, State, own_momentum};
use crate::integrator::carried_velocity::{Carried, Moving};
use crate::integrator::position_projection::FARTHEST;
use crate::lanes::rows::Answer;
use crate::lanes::sweeps::write_start;
use crate::scalar::{Lane, LaneMask, Vec3};
use crate::solver::batch::problem::ContactProblem;
use crate::system::extent::{displacement, tolerated};

/// Sweeps before pivoting, of machines with many contacts: a problem of six cylinders on hills with
/// cells of 0.25 m takes 5.0 systems without them, 3.0 after three and 2.3 after six. Thin wheels
/// begin at zero, so that a machine that is its own mirror image is moved alike on both sides.
const SWEEPS: usize = 4;

impl<T: Lane> Block<T> {
    /// Predicts the gaps at the end of the step; true if the position of a group must be projected.
    #[inline(always)]
    pub(super) fn measure(&mut self) -> bool {
        let (h, theta) = self.time_step();
        let zero = h.like(0.0);
        let mut deepest = std::mem::take(&mut self.deepest);
        deepest.fill(zero);
        for &slot in self.contacts.used() {
            let mut gap = self.gap_at_end(slot, h, theta);
            if let Some(lever) = self.lever(slot) {
                gap *= lever;
            }
            self.contacts.lower(slot, gap, &mut deepest);
        }
        self.contacts.spread_least(&mut deepest);
        self.deepest = deepest;
        let mut least = std::mem::take(&mut self.energies.number);
        for (cluster, least) in least.iter_mut().enumerate() {
            let stated = self.options.penetration_tolerance;
            *least = zero.like(tolerated(stated, &self.machine, cluster));
        }
        self.contacts.spread_least(&mut least);
        let mut is_any = false;
        let limits = self.deepest.iter().zip(&least);
        for (is_deep, (deepest, tolerated)) in self.is_deep.iter_mut().zip(limits) {
            *is_deep = deepest.lt(-*tolerated) & self.going;
            is_any |= is_deep.any();
        }
        self.energies.number = least;
        is_any
    }

    /// Gap of a slot after the step, m; 0 where it is negative and opening, or nothing can open it.
    #[inline(always)]
    fn gap_at_end(&self, slot: usize, h: T, theta: T) -> T {
        let zero = h.like(0.0);
        let own = self.contacts.slot(slot);
        let (u, before) = (self.u[slot][0], self.rows.u_before[slot][0]);
        let mut gap = own.gap + theta * h * (u - before);
        if !self.yields.is_empty() {
            let law = &self.yields.laws[slot];
            gap = T::select(law.is_soft(), law.unexplained, gap);
        }
        let parts = gap.lt(zero) & !(gap + h * u).lt(zero);
        let gap = T::select(parts | self.rows.immovable(slot), zero, gap);
        T::select(own.active, gap, zero)
    }

    /// Turns the problems into those of the position projection; none where nothing penetrates.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn set_gaps(&mut self, problems: &mut [ContactProblem]) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                let (h, theta) = self.time_step();
                let zero = h.like(0.0);
                let problems = &mut problems[..self.contacts.n_problems()];
                for (index, problem) in problems.iter_mut().enumerate() {
                    if !self.is_deep[index / T::LANES].get(Self::lane_of(index)) {
                        problem.n_contacts = 0;
                    }
                    let n = problem.n_unknowns();
                    problem.asks_least = false;
                    problem.is_solved = false;
                    problem.q[..n].fill(0.0);
                    problem.p[..n].fill(0.0);
                }
                for &slot in self.contacts.used() {
                    let gap = self.gap_at_end(slot, h, theta);
                    self.gaps[slot] = [gap, zero, zero];
                    self.pushes[slot] = [zero; 3];
                    let (homes, places) = (self.contacts.homes(slot), self.contacts.places(slot));
                    let is_deep = self.contacts.mask_of(slot, &self.is_deep);
                    let active = self.contacts.slot(slot).active & is_deep;
                    for lane in (0..T::LANES).filter(|lane| active.get(*lane)) {
                        let problem = &mut problems[usize::from(homes[lane])];
                        problem.q[3 * usize::from(places[lane])] = gap.get(lane);
                    }
                }
                let swept = self.any(&self.is_deep) & T::mask(self.token, self.contacts.factored());
                if swept.any() {
                    let data = (&self.gaps[..], &self.mu[..]);
                    let pushes = &mut self.pushes;
                    self.rows.sweep(&self.contacts, SWEEPS, data, pushes);
                    write_start(&self.contacts, swept, pushes, problems);
                }
            },
        );
    }

    /// Moves the penetrating lanes by the displacement that the problems found.
    pub(super) fn project(&mut self, problems: &mut [ContactProblem]) {
        let token = self.token;
        self.solve_by_method(problems);
        let mut unsolved = 0;
        for (index, problem) in problems[..self.n_problems()].iter().enumerate() {
            let lane = Self::lane_of(index);
            if problem.n_contacts > 0 && self.is_deep[index / T::LANES].get(lane) {
                unsolved |= u32::from(!problem.is_solved) << lane;
                let report = &mut self.reports[lane];
                report.iterations += problem.iterations;
                report.factorisations += problem.factorisations;
                report.pivots += problem.pivots;
                report.residual = report.residual.max(problem.residual.relative);
            }
        }
        self.fall_back(Fallback::Projection, T::mask(token, unsolved));
        let (drives, stored) = (&self.drives, &mut self.energies.stored[0]);
        drives.stored(
            &self.machine,
            T::splat(token, 0.0),
            &self.end.joints,
            stored,
        );
        T::vectorize(
            token,
            #[inline(always)]
            || self.displace(problems),
        );
        self.close_moved(self.any(&self.is_deep) & self.going);
        self.carry_velocity();
    }

    /// Carries the velocities of the groups that were moved to the projected position, and counts
    /// the energy that this added, as [`crate::integrator::energy_audit`] does.
    /// `energies.stored[0]`: in springs before it, J.
    fn carry_velocity(&mut self) {
        let is_moved = self.any(&self.is_deep) & self.going;
        if !is_moved.any() {
            return;
        }
        let work = self.drives.work_of_displacement(
            &self.machine,
            self.time_step(),
            &self.start.joints,
            [&self.v, &self.v_end, &self.y],
        ) + self.work_on_the_way();
        let token = self.token;
        self.weigh_moved();
        T::vectorize(
            token,
            #[inline(always)]
            || self.scale_carried(),
        );
        let mut own = std::mem::take(&mut self.energies);
        for (cluster, lifted) in self.energy(State::End).iter().enumerate() {
            own.lifted[cluster] = lifted.energy.kinetic_and_potential();
        }
        let zero = self.number(0.0);
        let [before, after] = &mut own.stored;
        (self.drives).stored(&self.machine, zero, &self.end.joints, after);
        let mut gained = zero;
        for (cluster, lifted) in own.lifted.iter().enumerate() {
            let lanes = self.is_deep[cluster] & self.going;
            let [kinetic, potential] = own.after[cluster];
            let stored = after[cluster] - before[cluster];
            let change = (lifted[0] - kinetic) + (lifted[1] - potential) + stored;
            gained += T::select(lanes, change, zero);
            own.after[cluster] = select_both(lanes, *lifted, own.after[cluster]);
        }
        self.energies = own;
        let gained = gained - work;
        for (lane, report) in self.reports.iter_mut().enumerate().take(T::LANES) {
            if is_moved.get(lane) {
                report.energy_supplied += work.get(lane);
                report.energy_lifted = gained.get(lane).max(0.0);
                report.energy_lost += (-gained.get(lane)).max(0.0);
            }
        }
    }

    /// `energies.kinetic` and `energies.momentum`: kinetic energies and momenta of the groups at
    /// the projected position, with the velocity before it.
    fn weigh_moved(&mut self) {
        let mut own = std::mem::take(&mut self.energies);
        let machine = Arc::clone(&self.machine);
        let token = self.token;
        for (cluster, found) in self.energy(State::End).iter().enumerate() {
            own.kinetic[cluster] = found.energy.kinetic;
            let momentum = own_momentum(token, &machine, cluster, found.momentum);
            for (sum, own) in own
                .momentum
                .iter_mut()
                .zip([momentum.x, momentum.y, momentum.z])
            {
                sum[cluster] = own;
            }
        }
        self.contacts.gather(&mut own.kinetic);
        for momentum in &mut own.momentum {
            self.contacts.gather(momentum);
            self.each_held(|leader, lane| momentum[leader].set(lane, 0.0));
        }
        self.energies = own;
    }

    /// Closes the loops of the groups that were moved.
    fn close_moved(&mut self, is_moved: T::Mask) {
        if self.rows.loops.is_none() || self.n_clusters() == 1 {
            self.close_end(is_moved);
            return;
        }
        self.middle.clone_from(&self.end);
        self.v_mean.copy_from_slice(&self.v_end);
        self.close_end(is_moved);
        let others = |cluster: usize| !self.is_deep[cluster];
        (self.end).select_clusters_from(&self.machine, others, &self.middle);
        let kept = self.v_mean.iter().zip(&self.cluster_of);
        for (v, (kept, cluster)) in self.v_end.iter_mut().zip(kept) {
            *v = T::select(!self.is_deep[*cluster], *kept, *v);
        }
    }

    #[inline(always)]
    fn scale_carried(&mut self) {
        let mut own = std::mem::take(&mut self.energies);
        for (cluster, balance) in self.balances.iter().enumerate() {
            let before = Moving {
                kinetic: balance.after[0],
                momentum: balance.momentum,
            };
            let [x, y, z] = own.momentum.each_ref().map(|all| all[cluster]);
            let after = Moving {
                kinetic: own.kinetic[cluster],
                momentum: Vec3::new(x, y, z),
            };
            let is_alone = !own.on_ground[cluster];
            let carried = Carried::new(before, after, own.mass[cluster], is_alone);
            own.kinetic[cluster] = carried.share;
            let Vec3 { x, y, z } = carried.common;
            for (all, common) in own.momentum.iter_mut().zip([x, y, z]) {
                all[cluster] = common;
            }
        }
        self.contacts.spread(&mut own.kinetic);
        for common in &mut own.momentum {
            self.contacts.spread(common);
        }
        let (shares, commons) = (&own.kinetic, &own.momentum);
        for tree in &self.machine.trees {
            let lanes = self.is_deep[tree.cluster] & self.going;
            let share = shares[tree.cluster];
            let axes = if tree.is_free { 3 } else { 0 };
            for (k, v) in self.v_end[tree.velocities.clone()].iter_mut().enumerate() {
                let mut own = share * *v;
                if k < axes {
                    own = commons[k][tree.cluster] + own;
                }
                *v = T::select(lanes, own, *v);
            }
        }
        for &slot in self.contacts.used() {
            let lanes = self.contacts.mask_of(slot, &self.is_deep) & self.going;
            let share = self.contacts.number_of(slot, shares);
            for u in &mut self.u[slot] {
                *u = T::select(lanes, *u * share, *u);
            }
        }
        self.energies = own;
    }

    #[inline(always)]
    fn displace(&mut self, problems: &[ContactProblem]) {
        let zero = self.number(0.0);
        let mut farthest = std::mem::take(&mut self.energies.number);
        farthest.fill(zero);
        for (index, problem) in problems[..self.n_problems()].iter().enumerate() {
            let (leader, lane, n) = (index / T::LANES, Self::lane_of(index), problem.n_unknowns());
            let mut most = farthest[leader].get(lane);
            let list = self.contacts.list(index);
            for (i, (u, q)) in problem.u[..n].iter().zip(&problem.q[..n]).enumerate() {
                let slot = usize::from(list.slots[i / 3]);
                let lever = self.lever(slot).map_or(1.0, |lever| lever.get(lane));
                most = most.max((u - q).abs() * lever);
            }
            farthest[leader].set(lane, most);
        }
        self.contacts.spread(&mut farthest);
        let mut pushes = std::mem::take(&mut self.pushes);
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, &mut pushes);
        if self.n_clusters() > 1 {
            for &slot in self.contacts.used() {
                let is_deep = self.contacts.mask_of(slot, &self.is_deep);
                pushes[slot] = pushes[slot].map(|push| T::select(is_deep, push, zero));
            }
        }
        self.y.fill(zero);
        let is_deep = self.any(&self.is_deep);
        self.rows
            .add_impulses(&self.contacts, is_deep, &pushes, &mut self.y);
        self.pushes = pushes;
        self.factor.half_solve_back(&self.machine, &mut self.y);
        let mut is_far = T::mask(self.token, 0);
        for (cluster, (farthest, deepest)) in farthest.iter().zip(&self.deepest).enumerate() {
            let size = displacement(zero, &self.machine, &self.y, cluster).max(*farthest);
            let limit = zero.like(-FARTHEST) * *deepest;
            is_far = is_far | (!size.le(limit) & self.is_deep[cluster]);
        }
        self.energies.number = farthest;
        self.fall_back(Fallback::Projection, is_far);
        self.middle
            .set_moved(&self.machine, &self.end, &self.y, 1.0);
        self.middle.normalise();
        let going = self.going;
        if let [is_deep] = self.is_deep[..] {
            self.end.select_from(is_deep & going, &self.middle);
        } else {
            let is_moved = |cluster: usize| self.is_deep[cluster] & going;
            (self.end).select_clusters_from(&self.machine, is_moved, &self.middle);
        }
    }
}
