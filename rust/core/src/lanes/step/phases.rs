//! The three parts of a step.

use std::sync::Arc;

use super::balance::{Balance, Conditions, Correction, Energies, select_both};
use super::{Block, Fallback, Next, State, own_momentum};
use crate::contact::clusters_of;
use crate::integrator::{Phase, Probe, Stabilisation, StepReport};
use crate::lanes::rows::Answer;
use crate::lanes::sweeps::write_start;
use crate::law::compliance::Held;
use crate::multibody::Model;
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::solver::batch::problem::ContactProblem;

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
        if is_first {
            self.apply_wrenches();
        }
        self.keep_mass_matrix();
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
            self.bounce_off_treads();
        }
        if !self.options.warm_start {
            self.forget_starts(problems, is_first);
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
        let problems_in_use = &mut problems[..self.contacts.n_problems()];
        for (index, problem) in problems_in_use.iter_mut().enumerate() {
            problem.begins_least = self.is_same[index / T::LANES].get(Self::lane_of(index));
        }
        self.await_answers(problems, self.asked(is_first));
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
        let lanes = self.asked(is_first);
        if self.options.warm_start {
            self.p.copy_from_slice(&self.p_last);
        } else {
            let zero = self.number(0.0);
            self.p.fill([zero; 3]);
        }
        let data = (&self.u[..], &self.mu[..]);
        self.rows.sweep(&self.contacts, SWEEPS, data, &mut self.p);
        write_start(&self.contacts, lanes, &self.p, problems);
    }

    /// Lanes whose problems are solved: those of lanes that are retaken unless `is_first`.
    #[inline(always)]
    fn asked(&self, is_first: bool) -> T::Mask {
        if is_first {
            self.occupied
        } else {
            self.retaken
        }
    }

    /// Lets the problems start from no impulses.
    #[cold]
    fn forget_starts(&self, problems: &mut [ContactProblem], is_first: bool) {
        let lanes = self.asked(is_first);
        for (index, problem) in problems[..self.n_problems()].iter_mut().enumerate() {
            if lanes.get(Self::lane_of(index)) {
                problem.p.fill(0.0);
            }
        }
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
        self.find_unknown();
        let (machine, contacts, token) = (&*self.machine, &self.contacts, self.token);
        let (unknown, masses) = (&self.energies.in_touch, &self.energies.mass);
        let fall = self.gravity.norm() * step.0;
        let weight = |slot: usize| {
            if let ([unknown], [mass]) = (&unknown[..], &masses[..]) {
                return (*unknown, *mass * fall);
            }
            let (mut lanes, mut weight) = (0, fall);
            for lane in 0..T::LANES {
                let cluster = contacts.own_cluster(slot, lane);
                lanes |= unknown[cluster].bits() & 1 << lane;
                weight.set(lane, masses[cluster].get(lane) * fall.get(lane));
            }
            (T::mask(token, lanes), weight)
        };
        self.yields.update(
            (machine, contacts),
            (&self.poses_middle, &self.v),
            step,
            &self.rows.u_before,
            &self.p_last,
            weight,
        );
    }

    /// `energies.in_touch`: by cluster, lanes that remember no contact; and the clusters' masses.
    fn find_unknown(&mut self) {
        let mut unknown = std::mem::take(&mut self.energies.in_touch);
        unknown.fill(T::mask(self.token, 0));
        for (lane, memory) in self.memories[..T::LANES].iter().enumerate() {
            let own = T::mask(self.token, 1 << lane);
            for (cluster, unknown) in unknown.iter_mut().enumerate() {
                let touches = |model: &Arc<Model>| {
                    let mut keys = memory.impulses.iter();
                    keys.any(|(key, _)| clusters_of(model, key).contains(&cluster))
                };
                let is_known = match &self.models[lane] {
                    Some(model) if self.balances.len() > 1 => touches(model),
                    _ => !memory.impulses.is_empty(),
                };
                if !is_known {
                    *unknown = *unknown | own;
                }
            }
        }
        self.energies.in_touch = unknown;
        for (cluster, mass) in self.energies.mass.iter_mut().enumerate() {
            *mass = self.inertias.mass_of(&self.machine, cluster);
        }
    }

    /// Configurations at the midpoint and at the predicted end.
    #[inline(always)]
    fn predict(&mut self) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        self.find_turning();
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
        self.solve_by_method(problems);
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
                    report.factorisations += problem.factorisations;
                    report.pivots += problem.pivots;
                    report.residual = report.residual.max(problem.residual.relative);
                }
            }
            solved |= u32::from(is_solved) << lane;
            self.reports[lane] = report;
            let memory = &mut self.next_memories[lane];
            self.contacts.remember(lane, problems, memory);
        }
        self.forget_bounces();
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
        self.weigh_ends();
        self.weigh_sand();
        T::vectorize(
            token,
            #[inline(always)]
            || self.audit(problems),
        );
        T::vectorize(
            token,
            #[inline(always)]
            || {
                for balance in &self.balances {
                    balance.report(&mut self.reports);
                }
            },
        );
        probe.end(Phase::Update);
        let is_deep = self.options.stabilisation == Stabilisation::Projection
            && T::vectorize(
                token,
                #[inline(always)]
                || self.measure(),
            );
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
            let own = (lane, self.models[lane].as_ref());
            let is_same = &mut self.is_same;
            (self.contacts).recall(own, &self.memories[lane], problems, is_same);
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
        self.rebound(-h.like(1.0));
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
        self.weigh_contacts();
    }

    /// Energies and momenta at the end of the step, of clusters and of groups.
    fn weigh_ends(&mut self) {
        let mut balances = std::mem::take(&mut self.balances);
        let mut own = std::mem::take(&mut self.energies);
        let machine = Arc::clone(&self.machine);
        let token = self.token;
        for (cluster, found) in self.energy(State::End).iter().enumerate() {
            own.after[cluster] = found.energy.kinetic_and_potential();
            balances[cluster].momentum = own_momentum(token, &machine, cluster, found.momentum);
        }
        for (balance, (before, after)) in
            (balances.iter_mut()).zip(own.before.iter().zip(&own.after))
        {
            (balance.before, balance.after) = (*before, *after);
        }
        if self.contacts.joined() != 0 {
            let number = &mut own.number;
            self.gather(&mut balances, number, |own| &mut own.before[0]);
            self.gather(&mut balances, number, |own| &mut own.before[1]);
            self.gather(&mut balances, number, |own| &mut own.after[0]);
            self.gather(&mut balances, number, |own| &mut own.after[1]);
            self.gather(&mut balances, number, |own| &mut own.momentum.x);
            self.gather(&mut balances, number, |own| &mut own.momentum.y);
            self.gather(&mut balances, number, |own| &mut own.momentum.z);
            self.each_held(|leader, lane| balances[leader].momentum.set(lane, [0.0; 3]));
        }
        (self.balances, self.energies) = (balances, own);
    }

    /// Sums a number over each group.
    fn gather(
        &self,
        balances: &mut [Balance<T>],
        numbers: &mut [T],
        of: impl Fn(&mut Balance<T>) -> &mut T,
    ) {
        for (number, balance) in numbers.iter_mut().zip(&mut *balances) {
            *number = *of(balance);
        }
        self.contacts.gather(numbers);
        for (number, balance) in numbers.iter().zip(balances) {
            *of(balance) = *number;
        }
    }

    /// Lets lanes of which a group does not balance fall back, and corrects the velocity of groups
    /// with a little too much energy.
    #[inline(always)]
    fn audit(&mut self, problems: &[ContactProblem]) {
        let (h, theta) = self.time_step();
        let mut own = std::mem::take(&mut self.energies);
        let mut balances = std::mem::take(&mut self.balances);
        let (places, velocities) = (&self.start.joints, [&self.v[..], &self.v_end]);
        let (machine, step, zero) = (&*self.machine, (h, theta), h.like(0.0));
        (self.drives).work(machine, step, places, velocities, &mut own.of_drives);
        self.add_work_of_wrenches(&mut own.of_drives);
        let [before, after] = &mut own.stored;
        self.drives.stored(machine, zero, places, before);
        (self.drives).stored(machine, zero, &self.end.joints, after);
        for (c, balance) in balances.iter_mut().enumerate() {
            balance.work = own.of_drives[c];
            balance.work.damped -= own.of_sand[c];
            balance.stored = own.stored[1][c] - own.stored[0][c];
        }
        if self.contacts.joined() != 0 {
            let number = &mut own.number;
            self.gather(&mut balances, number, |own| &mut own.work.supplied);
            self.gather(&mut balances, number, |own| &mut own.work.damped);
            self.gather(&mut balances, number, |own| &mut own.work.of_springs);
            self.gather(&mut balances, number, |own| &mut own.stored);
        }
        self.balances = balances;
        self.weigh_treads(&mut own);
        for (cluster, mass) in own.mass.iter_mut().enumerate() {
            *mass = self.inertias.mass_of(&self.machine, cluster);
        }
        self.find_touch(&mut own.in_touch);
        self.find_ground(&mut own.on_ground);
        self.contacts.gather(&mut own.mass);
        let nobody = T::mask(self.token, 0);
        let conserves = self.options.theta <= 0.5;
        let fall = self.gravity.norm() * h;
        let conditions = |c: usize| Conditions {
            mass: own.mass[c],
            fall,
            untouched: !own.on_ground[c],
            is_free: if conserves { !own.in_touch[c] } else { nobody },
        };
        let (mut is_lost, mut is_corrected) = (nobody, nobody);
        for (c, balance) in self.balances.iter_mut().enumerate() {
            let going = self.going & self.contacts.leads(c);
            is_lost = is_lost | balance.audit(own.released[c], &conditions(c), going);
            is_corrected = is_corrected | balance.is_corrected;
        }
        if is_corrected.any() {
            self.correct(problems, conditions);
        }
        self.energies = own;
        self.fall_back(Fallback::Energy, is_lost);
        if is_corrected.any() {
            self.weigh_ends();
        }
    }

    /// `own.released`: what the wheels that yield give off, by group.
    fn weigh_treads(&mut self, own: &mut Energies<T>) {
        own.released.fill(self.number(0.0));
        if self.yields.is_empty() {
            return;
        }
        let step = self.time_step();
        let contacts = &self.contacts;
        for sums in &mut own.elastic {
            sums.fill(self.number(0.0));
        }
        let both = [&self.rows.u_before[..], &self.u];
        let sums = own.elastic.each_mut().map(|sums| &mut sums[..]);
        (self.yields).held(contacts, step, &self.p, both, sums);
        for (cluster, known) in own.number.iter_mut().enumerate() {
            *known = self.number(f64::INFINITY);
            for (lane, memory) in self.memories[..T::LANES].iter().enumerate() {
                if memory.stored.len() == own.released.len() {
                    known.set(lane, memory.stored[cluster]);
                }
            }
        }
        // By cluster, as the general step does it.
        let [before, after, given] = &mut own.elastic;
        for (cluster, before) in before.iter_mut().enumerate() {
            let known = own.number[cluster];
            *before = T::select(known.is_finite(), known, *before);
            let own = Held {
                before: *before,
                most: after[cluster],
                given: given[cluster],
            };
            after[cluster] = own.after(*before);
        }
        for (lane, memory) in self.next_memories[..T::LANES].iter_mut().enumerate() {
            memory.stored.clear();
            (memory.stored).extend(after.iter().map(|after| after.get(lane)));
        }
        for sums in [&mut *before, &mut *after] {
            contacts.gather(sums);
        }
        for (released, (before, after)) in own.released.iter_mut().zip(before.iter().zip(&*after)) {
            *released = *before - *after;
        }
    }

    /// Corrects the velocities, and the local ones. `conditions`: of each group.
    fn correct(
        &mut self,
        problems: &[ContactProblem],
        conditions: impl Fn(usize) -> Conditions<T>,
    ) {
        let found = self.balances.iter().enumerate();
        let mut all: Vec<Correction<T>> = found
            .map(|(c, balance)| balance.correction(&conditions(c)))
            .collect();
        for lane in 0..T::LANES {
            for cluster in 0..all.len() {
                let leader = self.contacts.leader(cluster, lane);
                if leader != cluster {
                    let other = all[leader];
                    all[cluster].take(self.token, lane, &other);
                }
            }
        }
        for tree in &self.machine.trees {
            all[tree.cluster].apply(tree, &mut self.v_end);
        }
        self.note_violations(problems, &all);
        let lanes: Vec<T::Mask> = all.iter().map(|own| own.lanes).collect();
        let shares: Vec<T> = all.iter().map(|own| own.share).collect();
        for &slot in self.contacts.used() {
            let shortened = self.contacts.mask_of(slot, &lanes);
            let share = self.contacts.number_of(slot, &shares);
            for u in &mut self.u[slot] {
                *u = T::select(shortened, *u * share, *u);
            }
        }
    }

    /// Last part of a step. `problems`: those of [`Self::set_gaps`], solved, if a lane's position
    /// must be projected.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn finish(&mut self, problems: Option<&mut [ContactProblem]>, probe: &mut dyn Probe) {
        let token = self.token;
        if let Some(problems) = problems.filter(|_| self.any(&self.is_deep).any()) {
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
        let mut persists = std::mem::take(&mut self.persists);
        self.find_touch(&mut persists);
        for ((persists, same), impact) in
            (persists.iter_mut().zip(&self.is_same)).zip(&self.has_impact)
        {
            *persists = *persists & *same & !*impact;
        }
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
        let is_one = persists.len() == 1;
        for (cluster, (has, persists)) in self
            .has_persistent
            .iter_mut()
            .zip(&mut persists)
            .enumerate()
        {
            if !is_one {
                // As a rover that leaves the block and comes back.
                let zero = h.like(0.0);
                let mut is_any = going & !going;
                for (x, of) in self.persistent.iter().zip(&self.cluster_of) {
                    if *of == cluster {
                        is_any = is_any | zero.lt(x.abs());
                    }
                }
                *persists = *persists & is_any;
            }
            *has = (*has & !going) | (*persists & going);
        }
        self.persists = persists;
        self.start.select_from(going, &self.end);
        for (v, end) in self.v.iter_mut().zip(&self.v_end) {
            *v = T::select(going, *end, *v);
        }
        let Energies { before, after, .. } = &mut self.energies;
        for (before, after) in before.iter_mut().zip(after) {
            *before = select_both(going, *after, *before);
        }
        self.time = T::select(going, self.time + h, self.time);
        self.drives.accept(going);
        if let Some(sand) = &mut self.sand {
            sand.accept(going);
        }
    }
}
