//! The position projection: contacts that penetrate too deep are moved apart.

use super::balance::select_both;
use super::{Block, Fallback, State};
use crate::integrator::Stabilisation;
use crate::integrator::carried_velocity::{Carried, Moving};
use crate::integrator::position_projection::FARTHEST;
use crate::lanes::problem::ContactProblem;
use crate::lanes::rows::Answer;
use crate::lanes::sweeps::write_start;
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};
use crate::system::extent::displacement;

/// Sweeps before pivoting, of machines with many contacts: a problem of six cylinders on hills with
/// cells of 0.25 m takes 5.0 systems without them, 3.0 after three and 2.3 after six. Thin wheels
/// begin at zero, so that a machine that is its own mirror image is moved alike on both sides.
const SWEEPS: usize = 4;

impl<T: Lane> Block<T> {
    /// Penetration that is tolerated, m, if positions are projected.
    pub(super) fn tolerated(&self) -> Option<f64> {
        (self.options.stabilisation == Stabilisation::Projection)
            .then_some(self.options.penetration_tolerance)
    }

    /// Predicts the gaps at the end of the step; true if a lane's position must be projected.
    #[inline(always)]
    pub(super) fn measure(&mut self, tolerated: f64) -> bool {
        let (h, theta) = self.time_step();
        let zero = h.like(0.0);
        let mut deepest = zero;
        for &slot in self.contacts.used() {
            deepest = deepest.min(self.gap_at_end(slot, h, theta));
        }
        self.deepest = deepest;
        self.is_deep = deepest.lt(zero.like(-tolerated)) & self.going;
        self.is_deep.any()
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
                    if !self.is_deep.get(Self::lane_of(index)) {
                        problem.n_contacts = 0;
                    }
                    let n = problem.n_unknowns();
                    problem.asks_least = false;
                    problem.q[..n].fill(0.0);
                    problem.p[..n].fill(0.0);
                }
                for &slot in self.contacts.used() {
                    let gap = self.gap_at_end(slot, h, theta);
                    self.gaps[slot] = [gap, zero, zero];
                    self.pushes[slot] = [zero; 3];
                    let (homes, places) = (self.contacts.homes(slot), self.contacts.places(slot));
                    let active = self.contacts.slot(slot).active & self.is_deep;
                    for lane in (0..T::LANES).filter(|lane| active.get(*lane)) {
                        let problem = &mut problems[usize::from(homes[lane])];
                        problem.q[3 * usize::from(places[lane])] = gap.get(lane);
                    }
                }
                let swept = self.is_deep & T::mask(self.token, self.contacts.factored());
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
    pub(super) fn project(&mut self, problems: &[ContactProblem]) {
        let token = self.token;
        let mut unsolved = 0;
        for (index, problem) in problems[..self.n_problems()].iter().enumerate() {
            let lane = Self::lane_of(index);
            if self.is_deep.get(lane) {
                unsolved |= u32::from(!problem.is_solved) << lane;
                let report = &mut self.reports[lane];
                report.iterations += problem.iterations;
                report.factorisations += problem.iterations;
                report.residual = report.residual.max(problem.residual.relative);
            }
        }
        self.fall_back(Fallback::Projection, T::mask(token, unsolved));
        let stored = self.drives.stored(self.number(0.0), &self.end.joints);
        T::vectorize(
            token,
            #[inline(always)]
            || self.displace(problems),
        );
        self.close_end(self.is_deep & self.going);
        self.carry_velocity(stored);
    }

    /// Carries the velocity to the projected position, and counts the energy that this added, as
    /// [`crate::integrator::energy_audit`] does. `stored`: in springs before it, J.
    fn carry_velocity(&mut self, stored: T) {
        let is_moved = self.is_deep & self.going;
        if !is_moved.any() {
            return;
        }
        let work = self.drives.work_of_displacement(
            &self.machine,
            self.time_step(),
            &self.start.joints,
            [&self.v, &self.v_end, &self.y],
        );
        let (moved, momentum) = self.energy(State::End);
        let after = Moving {
            kinetic: moved.kinetic,
            momentum: self.own_momentum(momentum),
        };
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.scale_carried(after, is_moved),
        );
        let after = self.energy(State::End).0.kinetic_and_potential();
        let [kinetic, potential] = self.balance.after;
        let stored = self.drives.stored(self.number(0.0), &self.end.joints) - stored;
        let gained = (after[0] - kinetic) + (after[1] - potential) + stored - work;
        for (lane, report) in self.reports.iter_mut().enumerate().take(T::LANES) {
            if is_moved.get(lane) {
                report.energy_supplied += work.get(lane);
                report.energy_lifted = gained.get(lane).max(0.0);
                report.energy_lost += (-gained.get(lane)).max(0.0);
            }
        }
        self.balance.after = select_both(is_moved, after, self.balance.after);
    }

    #[inline(always)]
    fn scale_carried(&mut self, after: Moving<T>, lanes: T::Mask) {
        let before = Moving {
            kinetic: self.balance.after[0],
            momentum: self.balance.momentum,
        };
        let is_alone = !self.on_ground();
        let carried = Carried::new(before, after, self.inertias.mass, is_alone);
        let Vec3 { x, y, z } = carried.common;
        for tree in &self.machine.trees {
            let axes = if tree.is_free { 3 } else { 0 };
            for (k, v) in self.v_end[tree.velocities.clone()].iter_mut().enumerate() {
                let mut own = carried.share * *v;
                if k < axes {
                    own = [x, y, z][k] + own;
                }
                *v = T::select(lanes, own, *v);
            }
        }
        for &slot in self.contacts.used() {
            for u in &mut self.u[slot] {
                *u = T::select(lanes, *u * carried.share, *u);
            }
        }
    }

    #[inline(always)]
    fn displace(&mut self, problems: &[ContactProblem]) {
        let zero = self.number(0.0);
        let mut farthest = [0.0_f64; MAX_LANES];
        for (index, problem) in problems[..self.n_problems()].iter().enumerate() {
            let (lane, n) = (Self::lane_of(index), problem.n_unknowns());
            for (u, q) in problem.u[..n].iter().zip(&problem.q[..n]) {
                farthest[lane] = farthest[lane].max((u - q).abs());
            }
        }
        let farthest = T::load(self.token, &farthest[..T::LANES]);
        let mut pushes = std::mem::take(&mut self.pushes);
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, &mut pushes);
        self.y.fill(zero);
        self.rows
            .add_impulses(&self.contacts, self.is_deep, &pushes, &mut self.y);
        self.pushes = pushes;
        self.factor.half_solve_back(&self.machine, &mut self.y);
        let size = displacement(zero, &self.machine, &self.y).max(farthest);
        let limit = zero.like(-FARTHEST) * self.deepest;
        self.fall_back(Fallback::Projection, !size.le(limit) & self.is_deep);
        let is_moved = self.is_deep & self.going;
        self.middle
            .set_moved(&self.machine, &self.end, &self.y, 1.0);
        self.middle.normalise();
        self.end.select_from(is_moved, &self.middle);
    }
}
