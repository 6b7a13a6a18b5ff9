//! The three parts of a step.

use super::balance::{Conditions, select_both};
use super::{Block, Fallback, Next, State};
use crate::integrator::{Phase, Probe, StepReport};
use crate::lanes::problem::ContactProblem;
use crate::lanes::rows::Answer;
use crate::lanes::sweeps::write_start;
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::system::extent::Turning;

/// Sweeps before pivoting, of machines with many contacts. Measured on six cylinders with torques
/// of up to 60 N m, drawn anew every ten steps: 3.4 systems a problem after one, 3.1 after two, 3.0
/// after four; a sweep costs about a third of a system. Thin wheels would need half their systems
/// too, but parked ones then press against each other with what the sweeps leave.
const SWEEPS: usize = 2;

impl<T: Lane> Block<T> {
    /// First part of a step: everything up to the friction-contact problems, which it writes.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn prepare(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) {
        let token = self.token;
        self.going = self.occupied;
        self.reasons = [None; MAX_LANES];
        self.n_retaken = [0; MAX_LANES];
        T::vectorize(
            token,
            #[inline(always)]
            || self.predict(),
        );
        self.poses_middle
            .update(&self.machine, &self.inertias, &self.middle);
        self.poses_end
            .update(&self.machine, &self.inertias, &self.end);
        probe.end(Phase::Kinematics);
        self.detect(problems);
        probe.end(Phase::Detection);
        self.set_up(problems, true, probe);
    }

    /// The friction-contact problems of the contacts found, from the mass matrix on; `is_first`:
    /// unless the step is taken again.
    fn set_up(&mut self, problems: &mut [ContactProblem], is_first: bool, probe: &mut dyn Probe) {
        let token = self.token;
        self.mass_matrix
            .update(&self.machine, &self.inertias, &self.poses_middle);
        T::vectorize(
            token,
            #[inline(always)]
            || self.add_implicit(is_first),
        );
        self.sink(is_first);
        probe.end(Phase::MassMatrix);
        let is_definite = self
            .mass_matrix
            .factorise_in_place(&self.machine, &mut self.factor);
        self.fall_back(Fallback::MassMatrix, !is_definite);
        probe.end(Phase::Factor);
        let (machine, end) = (&*self.machine, &self.poses_end);
        let (middle, joints) = (&self.poses_middle, &self.middle.joints);
        self.rows.begin_loops(machine, middle, joints, &self.factor);
        self.rows
            .assemble(machine, end, &self.factor, &self.contacts, &self.v);
        if is_first {
            T::vectorize(
                token,
                #[inline(always)]
                || self.recall(problems),
            );
        }
        if !self.yields.is_empty() {
            let laws = &self.yields.laws;
            self.rows.soften(&self.contacts, |slot| laws[slot].diagonal);
        }
        self.rows.close_held(&self.contacts);
        probe.end(Phase::Delassus);
        self.load();
        self.rows
            .to_problems(&self.contacts, &self.u, &self.mu, problems);
        let same = self.is_same.bits();
        let problems_in_use = &mut problems[..self.contacts.n_problems()];
        for (index, problem) in problems_in_use.iter_mut().enumerate() {
            problem.begins_least = same >> Self::lane_of(index) & 1 == 1;
        }
        probe.end(Phase::Bias);
        if self.contacts.factored() != 0 {
            T::vectorize(
                token,
                #[inline(always)]
                || self.begin_near(problems, is_first),
            );
        }
    }

    /// Finds impulses for the problems to start from, those of lanes that are retaken unless
    /// `is_first`: the others have their answers.
    #[inline(always)]
    fn begin_near(&mut self, problems: &mut [ContactProblem], is_first: bool) {
        let lanes = if is_first {
            self.occupied
        } else {
            self.retaken
        };
        self.p.copy_from_slice(&self.p_last);
        let data = (&self.u[..], &self.mu[..]);
        self.rows.sweep(&self.contacts, SWEEPS, data, &mut self.p);
        write_start(&self.contacts, lanes, &self.p, problems);
    }

    /// Impulses of the last step by slot, and the laws of contacts that yield.
    #[inline(always)]
    fn recall(&mut self, problems: &[ContactProblem]) {
        let last = &mut self.p_last;
        (self.rows).read(&self.contacts, problems, Answer::Impulses, last);
        if self.yields.is_empty() {
            return;
        }
        let step = self.time_step();
        let mut unknown = 0;
        for (lane, memory) in self.memories[..T::LANES].iter().enumerate() {
            unknown |= u32::from(memory.impulses.is_empty()) << lane;
        }
        let weight = self.inertias.mass * self.gravity.norm() * step.0;
        self.yields.update(
            (&self.machine, &self.contacts),
            (&self.poses_middle, &self.v),
            step,
            &self.rows.u_before,
            &self.p_last,
            (T::mask(self.token, unknown), weight),
        );
    }

    /// Configurations at the midpoint and at the predicted end.
    #[inline(always)]
    fn predict(&mut self) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        let zero = self.number(0.0);
        let is_fast = Turning::of(zero, &self.machine, &self.v).is_gyroscopic(self.number(h));
        self.fall_back(Fallback::Turning, is_fast);
        let machine = &*self.machine;
        self.middle
            .set_moved(machine, &self.start, &self.v, (1.0 - theta) * h);
        self.end.set_moved(machine, &self.start, &self.v, h);
    }

    /// Second part of a step: the new velocity and configuration, and their energy.
    ///
    /// `problems`: those of [`Self::prepare`], solved.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn conclude(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) -> Next {
        let token = self.token;
        let mut solved = 0;
        for lane in 0..T::LANES {
            let mut report = StepReport {
                steps: 1,
                retaken: self.n_retaken[lane],
                immovable_contacts: self.rows.n_immovable(&self.contacts, lane),
                ..StepReport::default()
            };
            let mut is_solved = true;
            for index in self.contacts.problems_of(lane) {
                let problem = &problems[index];
                if problem.n_contacts > 0 {
                    is_solved &= problem.is_solved;
                    report.n_contacts += problem.n_contacts;
                    report.iterations += problem.iterations;
                    report.factorisations += problem.iterations;
                    report.residual = report.residual.max(problem.residual.relative);
                }
            }
            solved |= u32::from(is_solved) << lane;
            self.reports[lane] = report;
            let memory = &mut self.next_memories[lane];
            self.contacts.remember(lane, problems, memory);
        }
        self.fall_back(Fallback::Solver, !T::mask(token, solved));
        T::vectorize(
            token,
            #[inline(always)]
            || self.move_on(problems),
        );
        self.close_end(self.going);
        if (self.drives.has_motors() || self.sand.is_some()) && self.revise(problems, probe) {
            return Next::Retake;
        }
        let (after, momentum) = self.energy(State::End);
        self.balance.after = after.kinetic_and_potential();
        self.balance.momentum = self.own_momentum(momentum);
        let of_sand = self.work_of_sand();
        T::vectorize(
            token,
            #[inline(always)]
            || self.audit(of_sand),
        );
        if self.balance.is_corrected.any() {
            self.weigh_again();
        }
        T::vectorize(
            token,
            #[inline(always)]
            || self.balance.report(&mut self.reports),
        );
        probe.end(Phase::Update);
        let is_deep = self.tolerated().is_some_and(|tolerated| {
            T::vectorize(
                token,
                #[inline(always)]
                || self.measure(tolerated),
            )
        });
        if is_deep { Next::Project } else { Next::Finish }
    }

    /// Where a motor has left its branch, or the force of the sand is another, sets up the step
    /// anew; true if there is such a lane. The other lanes keep their answers.
    fn revise(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) -> bool {
        let mut may_revise = 0;
        for (lane, n) in self.n_retaken[..T::LANES].iter().enumerate() {
            may_revise |= u32::from(*n < self.most_revisions(lane)) << lane;
        }
        let lanes = self.going & T::mask(self.token, may_revise);
        let spent = self.going & !T::mask(self.token, may_revise);
        if spent.any() {
            let unsettled = self.revise_sand(spent);
            self.fall_back(Fallback::Sand, unsettled);
        }
        let (drives, machine) = (&mut self.drives, &*self.machine);
        let (v, v_end) = (&self.v, &self.v_end);
        self.retaken = T::vectorize(
            self.token,
            #[inline(always)]
            || drives.revise(machine, lanes, v, v_end),
        );
        self.retaken = self.retaken | self.revise_sand(lanes);
        if !self.retaken.any() {
            return false;
        }
        for lane in (0..T::LANES).filter(|&lane| self.retaken.get(lane)) {
            self.n_retaken[lane] += 1;
            (self.contacts).recall(lane, &self.memories[lane], problems);
        }
        self.set_up(problems, false, probe);
        true
    }

    #[inline(always)]
    fn move_on(&mut self, problems: &[ContactProblem]) {
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, &mut self.p);
        self.rows
            .read(&self.contacts, problems, Answer::Velocities, &mut self.u);
        self.yields.unshift(&self.contacts, &self.p, &mut self.u);
        let (h, _) = self.time_step();
        self.hold_joints(h);
        self.rows
            .add_impulses(&self.contacts, self.occupied, &self.p, &mut self.y);
        self.factor.half_solve_back(&self.machine, &mut self.y);
        for ((end, v), change) in self.v_end.iter_mut().zip(&self.v).zip(&self.y) {
            *end = *v + *change;
        }
        let share = self.options.theta * self.options.time_step;
        self.end
            .set_moved(&self.machine, &self.middle, &self.v_end, share);
        self.end.normalise();
        self.find_impacts();
        self.balance.contact_work = self.contact_work();
    }

    /// Lets lanes whose step does not balance fall back, and corrects the velocity of those with a
    /// little too much energy.
    #[inline(always)]
    fn audit(&mut self, of_sand: T) {
        let (h, theta) = self.time_step();
        let places = &self.start.joints;
        let mut work =
            (self.drives).work(&self.machine, (h, theta), places, [&self.v, &self.v_end]);
        work.damped -= of_sand;
        self.balance.work = work;
        let zero = h.like(0.0);
        let stored = |places: &[T]| self.drives.stored(zero, places);
        self.balance.stored = stored(&self.end.joints) - stored(places);
        let mut released = h.like(0.0);
        if !self.yields.is_empty() {
            let (contacts, before) = (&self.contacts, &self.rows.u_before);
            released = self.yields.supplied(contacts, h, &self.p, &self.u, before);
        }
        let nobody = T::mask(self.token, 0);
        let conserves = self.options.theta <= 0.5;
        let conditions = Conditions {
            mass: self.inertias.mass,
            fall: self.gravity.norm() * h,
            untouched: !self.on_ground(),
            is_free: if conserves { !self.in_touch() } else { nobody },
        };
        let is_lost = (self.balance).audit(released, &conditions, self.going);
        self.fall_back(Fallback::Energy, is_lost);
        if self.balance.is_corrected.any() {
            let trees = &self.machine.trees;
            let (shortened, share) = self.balance.correct(&conditions, trees, &mut self.v_end);
            for &slot in self.contacts.used() {
                for u in &mut self.u[slot] {
                    *u = T::select(shortened, *u * share, *u);
                }
            }
        }
    }

    /// Energy of the lanes whose velocity was corrected.
    fn weigh_again(&mut self) {
        let (after, momentum) = self.energy(State::End);
        self.balance.momentum = self.own_momentum(momentum);
        let (balance, after) = (&mut self.balance, after.kinetic_and_potential());
        balance.after = select_both(balance.is_corrected, after, balance.after);
    }

    /// Last part of a step. `problems`: those of [`Self::set_gaps`], solved, if a lane's position
    /// must be projected.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn finish(&mut self, problems: Option<&[ContactProblem]>, probe: &mut dyn Probe) {
        let token = self.token;
        if let Some(problems) = problems.filter(|_| self.is_deep.any()) {
            self.project(problems);
        }
        probe.end(Phase::Projection);
        T::vectorize(
            token,
            #[inline(always)]
            || self.accept(),
        );
        self.note_ruts();
        let going = self.going.bits();
        for lane in 0..T::LANES {
            if going >> lane & 1 == 1 {
                std::mem::swap(&mut self.memories[lane], &mut self.next_memories[lane]);
            }
        }
    }

    /// Makes the end of the step the state of the lanes that are still going.
    #[inline(always)]
    fn accept(&mut self) {
        let mut is_finite = self.end.is_finite();
        for v in &self.v_end {
            is_finite = is_finite & v.is_finite();
        }
        self.fall_back(Fallback::NotFinite, !is_finite);
        let going = self.going;
        let (h, _) = self.time_step();
        self.rows.find_loop_impulses(&self.contacts, going, &self.p);
        let persists = self.is_same & self.in_touch() & !self.has_impact;
        let (contacts, end) = (&self.contacts, &self.poses_end);
        self.rows.generalized_impulse(
            &self.machine,
            contacts,
            end,
            going,
            &self.p,
            &mut self.pushed,
        );
        for (own, pushed) in self.persistent.iter_mut().zip(&self.pushed) {
            *own = T::select(going, *pushed, *own);
        }
        self.has_persistent = (self.has_persistent & !going) | (persists & going);
        self.start.select_from(going, &self.end);
        for (v, end) in self.v.iter_mut().zip(&self.v_end) {
            *v = T::select(going, *end, *v);
        }
        self.balance.before = select_both(going, self.balance.after, self.balance.before);
        self.time = T::select(going, self.time + h, self.time);
        self.drives.accept(going);
        if let Some(sand) = &mut self.sand {
            sand.accept(going);
        }
    }
}
