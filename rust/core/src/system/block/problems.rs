//! The problems of a block: how they are posed, and what their answers say.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::system::LaneSystem;
use crate::contact::slots::sweeps::write_start;
use crate::contact::{ContactKey, clusters_of};
use crate::integrator::grouped::Grouped;
use crate::integrator::{StepOptions, StepReport, WarmStart};
use crate::multibody::Model;
use crate::scalar::{Lane, LaneMask, inlined};
use crate::solver::batch::problem::{ContactProblem, Triple};
use crate::solver::{Method, SolverOptions};

/// Sweeps before pivoting, of machines with many contacts. Measured on six cylinders with torques
/// of up to 60 N m, drawn anew every ten steps: 3.4 systems a problem after one, 3.1 after two, 3.0
/// after four; a sweep costs about a third of a system. Thin wheels would need half their systems
/// too, but parked ones then press against each other with what the sweeps leave.
const SWEEPS: usize = 2;

/// Sweeps before pivoting of the projection, of machines with many contacts: a problem of six
/// cylinders on hills with cells of 0.25 m takes 5.0 systems without them, 3.0 after three and 2.3
/// after six. Thin wheels begin at zero, so that a machine that is its own mirror image is moved
/// alike on both sides.
const SWEEPS_OF_GAPS: usize = 4;

impl<T: Lane> LaneSystem<T> {
    /// Writes the problems; those of a mask's lanes have no answer yet.
    pub(super) fn write_problems(
        &mut self,
        options: &StepOptions,
        q: &[Triple<T>],
        start: &[Triple<T>],
        is_same: &[T::Mask],
        lanes: T::Mask,
        problems: &mut [ContactProblem],
    ) {
        let n = self.contacts.n_problems();
        if !options.warm_start {
            for (index, problem) in problems[..n].iter_mut().enumerate() {
                if lanes.get(index % T::LANES) {
                    problem.p.fill(0.0);
                }
            }
        }
        let loops = self.tree.loops.as_deref();
        let data = (q, &self.mu[..]);
        (self.rows).to_problems(&self.contacts, data, problems, loops);
        for (index, problem) in problems[..n].iter_mut().enumerate() {
            problem.begins_least = is_same[index / T::LANES].get(index % T::LANES);
        }
        if options.solver.method != Method::Auto {
            for (index, problem) in problems[..n].iter_mut().enumerate() {
                problem.is_solved &= !lanes.get(index % T::LANES);
            }
        }
        if self.contacts.factored() != 0 {
            inlined!(
                T::vectorize,
                self.token,
                self.begin_near(options, q, start, lanes, problems)
            );
        }
    }

    /// Finds impulses for the problems of some lanes to start from.
    #[inline(always)]
    fn begin_near(
        &mut self,
        options: &StepOptions,
        q: &[Triple<T>],
        start: &[Triple<T>],
        lanes: T::Mask,
        problems: &mut [ContactProblem],
    ) {
        if options.warm_start {
            self.swept.copy_from_slice(start);
        } else {
            let zero = self.number(0.0);
            self.swept.fill([zero; 3]);
        }
        let data = (q, &self.mu[..]);
        let loops = self.tree.loops.as_deref();
        (self.rows).sweep(&self.contacts, SWEEPS, data, &mut self.swept, loops);
        write_start(&self.contacts, lanes, &self.swept, problems);
    }

    /// Solves the problems without an answer by a method that no queue knows, or those that a queue
    /// has not solved.
    fn solve_by_method(
        &mut self,
        options: &SolverOptions,
        going: T::Mask,
        problems: &mut [ContactProblem],
    ) {
        let problems = &mut problems[..self.contacts.n_problems()];
        for (index, problem) in problems.iter_mut().enumerate() {
            let is_going = going.get(index % T::LANES);
            if is_going && problem.n_contacts > 0 && !problem.is_solved {
                let own = self.by_method.get_or_insert_default();
                own.solve(problem, options);
            }
        }
    }

    /// Fills the problems' `p` with the impulses that a rover remembers of its contacts, N s, zero
    /// for new ones. Marks in `is_same` each cluster whose group had exactly these contacts in the
    /// last step.
    #[inline(always)]
    pub(super) fn recall_impulses(
        &self,
        lane: usize,
        memory: &WarmStart,
        problems: &mut [ContactProblem],
        is_same: &mut [T::Mask],
    ) {
        let (contacts, own) = (&self.contacts, T::mask(self.token, 1 << lane));
        let (mut n, mut n_known) = (0, 0);
        for (index, is_same) in contacts.problems_of(lane).zip(&mut *is_same) {
            let (list, problem) = (contacts.list(index), &mut problems[index]);
            let n_before = n_known;
            for (place, out) in problem.p.chunks_exact_mut(3).enumerate().take(list.n) {
                let wanted = list.keys[place];
                let same = memory.impulses.get(n + place);
                let known = if let Some((_, known)) = same.filter(|(key, _)| *key == wanted) {
                    n_known += 1;
                    *known
                } else {
                    let found = memory.impulses.iter().find(|(key, _)| *key == wanted);
                    n_known += usize::from(found.is_some());
                    found.map_or([0.0; 3], |(_, known)| *known)
                };
                out.copy_from_slice(&known);
            }
            n += list.n;
            let has_new = n_known - n_before != list.n;
            *is_same = (*is_same & !own) | (if has_new { own & !own } else { own });
        }
        if n_known == memory.impulses.len() {
            // Followers have no list: what their leaders say holds for them.
        } else if let [only] = &mut *is_same {
            *only = *only & !own;
        } else if let Some(model) = &self.tree.models[lane] {
            self.note_lost(lane, model, memory, is_same);
        }
        contacts.intersect(is_same);
    }

    /// Takes the mark from clusters that have lost a contact.
    #[cold]
    fn note_lost(&self, lane: usize, model: &Model, memory: &WarmStart, is_same: &mut [T::Mask]) {
        let others = !T::mask(self.token, 1 << lane);
        let has = |wanted: &ContactKey| {
            let contacts = &self.contacts;
            let mut lists = contacts.problems_of(lane).map(|index| contacts.list(index));
            lists.any(|list| list.keys[..list.n].contains(wanted))
        };
        for (key, _) in memory.impulses.iter().filter(|(key, _)| !has(key)) {
            for cluster in clusters_of(model, key) {
                is_same[cluster] = is_same[cluster] & others;
            }
        }
    }

    /// Makes a rover remember the impulses of its contacts, the problems' `p`, N s.
    #[inline(always)]
    fn remember(&self, lane: usize, problems: &[ContactProblem], memory: &mut WarmStart) {
        memory.impulses.clear();
        for index in self.contacts.problems_of(lane) {
            let (list, problem) = (self.contacts.list(index), &problems[index]);
            for (place, p) in problem.p.chunks_exact(3).enumerate().take(list.n) {
                let known = (list.keys[place], [p[0], p[1], p[2]]);
                memory.impulses.push(known);
            }
        }
    }

    /// Enters the answers in reports and memories; returns the lanes whose problems are solved.
    pub(super) fn read_answers(
        &mut self,
        options: &StepOptions,
        going: T::Mask,
        problems: &mut [ContactProblem],
        reports: &mut [StepReport],
        memories: &mut [WarmStart],
    ) -> T::Mask {
        self.solve_by_method(&options.solver, going, problems);
        let mut solved = 0;
        for (lane, memory) in memories.iter_mut().enumerate() {
            let report = &mut reports[lane];
            report.immovable_contacts = self.rows.n_immovable(&self.contacts, lane);
            let mut is_solved = true;
            for index in self.contacts.problems_of(lane) {
                let problem = &problems[index];
                if problem.n_contacts > 0 {
                    is_solved &= problem.is_solved;
                    report.n_contacts += problem.n_contacts;
                    enter(report, problem);
                }
            }
            solved |= u32::from(is_solved) << lane;
            self.remember(lane, problems, memory);
        }
        T::mask(self.token, solved)
    }

    /// Whether a lane's memory has a contact of a cluster.
    pub(super) fn knows(&self, lane: usize, memory: &WarmStart, cluster: usize) -> bool {
        let mut keys = memory.impulses.iter();
        match &self.tree.models[lane] {
            Some(model) => keys.any(|(key, _)| clusters_of(model, key).contains(&cluster)),
            None => !memory.impulses.is_empty(),
        }
    }

    /// Turns the problems into those of the position projection.
    #[inline(always)]
    pub(super) fn write_gaps(
        &mut self,
        gaps: &[Triple<T>],
        is_deep: &[T::Mask],
        pushes: &mut [Triple<T>],
        problems: &mut [ContactProblem],
    ) {
        let problems = &mut problems[..self.contacts.n_problems()];
        let mut all = 0;
        for (index, problem) in problems.iter_mut().enumerate() {
            if !is_deep[index / T::LANES].get(index % T::LANES) {
                problem.n_contacts = 0;
            }
            let n = problem.n_unknowns();
            problem.asks_least = false;
            problem.is_solved = false;
            problem.q[..n].fill(0.0);
            problem.p[..n].fill(0.0);
        }
        for own in is_deep {
            all |= own.bits();
        }
        for &slot in self.contacts.used() {
            let (problem_indices, places) = (
                self.contacts.problem_indices(slot),
                self.contacts.places(slot),
            );
            let is_deep = self.contacts.mask_of(slot, is_deep);
            let active = self.contacts.slot(slot).active & is_deep;
            for lane in (0..T::LANES).filter(|lane| active.get(*lane)) {
                let problem = &mut problems[usize::from(problem_indices[lane])];
                problem.q[3 * usize::from(places[lane])] = gaps[slot][0].get(lane);
            }
        }
        let swept = T::mask(self.token, all & self.contacts.factored());
        if swept.any() {
            let data = (gaps, &self.mu[..]);
            let loops = self.tree.loops.as_deref();
            (self.rows).sweep(&self.contacts, SWEEPS_OF_GAPS, data, pushes, loops);
            write_start(&self.contacts, swept, pushes, problems);
        }
    }

    /// Enters the answers of the projection in the reports; returns the lanes of which one is not
    /// solved.
    pub(super) fn read_displacements(
        &mut self,
        options: &StepOptions,
        going: T::Mask,
        problems: &mut [ContactProblem],
        is_deep: &[T::Mask],
        reports: &mut [StepReport],
        farthest: &mut [T],
    ) -> T::Mask {
        let solver = SolverOptions {
            acceptable: 0.0, // is a speed, not a displacement
            ..options.solver
        };
        self.solve_by_method(&solver, going, problems);
        let mut unsolved = 0;
        for (index, problem) in problems[..self.contacts.n_problems()].iter().enumerate() {
            let (leader, lane, n) = (index / T::LANES, index % T::LANES, problem.n_unknowns());
            if problem.n_contacts > 0 && is_deep[leader].get(lane) {
                unsolved |= u32::from(!problem.is_solved) << lane;
                enter(&mut reports[lane], problem);
            }
            let mut most = farthest[leader].get(lane);
            let list = self.contacts.list(index);
            for (i, (u, q)) in problem.u[..n].iter().zip(&problem.q[..n]).enumerate() {
                let lever = self.lever_of(usize::from(list.slots[i / 3]));
                most = most.max((u - q).abs() * lever);
            }
            farthest[leader].set(lane, most);
        }
        T::mask(self.token, unsolved)
    }
}

/// Enters a solved problem in a report.
fn enter(report: &mut StepReport, problem: &ContactProblem) {
    report.iterations += problem.iterations;
    report.factorisations += problem.factorisations;
    report.pivots += problem.pivots;
    report.acceptable += usize::from(problem.is_acceptable);
    report.fallbacks |= usize::from(problem.is_escalated);
    report.residual = report.residual.max(problem.residual.relative);
}
