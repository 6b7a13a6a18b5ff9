//! The two as one mechanical system.

use super::contact::{CompositeContact, GrainTouch};
use super::parts::CompositeScratch;
use super::touches;
use crate::contact::{Activation, Contact, generalized_impulse};
use crate::integrator::{
    Dynamics, Forces, MechanicalSystem, StepOptions, StepStart, UnilateralContact, Work,
};
use crate::law::compliance::Compliance;
use crate::multibody::LaneConfiguration;
use crate::problem::{
    BlockSparseDelassus, BodyPairs, Dimension, FrictionContactProblem, RoundPair,
};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace};
use crate::system::grains::GrainSystem;
use crate::system::grains::system::gap_law;
use crate::system::tree::TreeSystem;

/// A tree among balls in a step.
pub struct TreeAmongGrains<'a> {
    /// The balls.
    pub bed: GrainSystem<'a, 3>,
    /// The tree.
    pub tree: TreeSystem<'a>,
    /// μ of the tree's parts on grains.
    pub friction: f64,
    /// Scratch.
    pub parts: &'a mut CompositeScratch,
}

type Both = (Vec<f64>, LaneConfiguration<f64>);

/// Report of the harder of two solves, with the work of both.
fn harder(a: &SolveReport, b: &SolveReport) -> SolveReport {
    let worst = if a.is_converged() && (!b.is_converged() || b.residual > a.residual) {
        b
    } else {
        a
    };
    SolveReport {
        iterations: a.iterations + b.iterations,
        work: a.work + b.work,
        residual: a.residual.max(b.residual),
        velocity_error: a.velocity_error.max(b.velocity_error),
        ..*worst
    }
}

impl TreeAmongGrains<'_> {
    /// Velocities of the grains, and of the tree.
    fn halves<'v>(&self, v: &'v [f64]) -> (&'v [f64], &'v [f64]) {
        v.split_at(self.bed.nv())
    }

    fn halves_mut<'v>(&self, v: &'v mut [f64]) -> (&'v mut [f64], &'v mut [f64]) {
        v.split_at_mut(self.bed.nv())
    }

    /// Where a step begins, of each side.
    fn starts<'q>(
        &self,
        start: StepStart<'q, Both>,
    ) -> (
        StepStart<'q, Vec<f64>>,
        StepStart<'q, LaneConfiguration<f64>>,
    ) {
        let ((q_a, q_b), (v_a, v_b)) = (start.configuration, self.halves(start.v));
        let of_grains = StepStart::at(q_a, v_a);
        let of_tree = StepStart::at(q_b, v_b);
        (of_grains, of_tree)
    }

    /// The pairs of the touches, of the side of the grains.
    fn touching(&self) -> impl Iterator<Item = &RoundPair<3>> {
        let pairs = self.bed.parts.pairs.machine.iter();
        pairs.skip(self.parts.of_tree.len())
    }

    /// Subtracts the grains' velocities from those of the touches.
    fn subtract_points(&self, touches: &[GrainTouch], v: &[f64], u: &mut [f64]) {
        for (touch, u) in touches.iter().zip(u.as_chunks_mut::<3>().0) {
            (self.bed).subtract_point(touch.pushed(), v, &touch.contact.frame.rows(), u);
        }
    }

    /// Adds the tree as the machine of the grains' pairs, with its own contacts and the touches.
    fn push_tree(&self, pairs: &mut BodyPairs<3>) {
        let (bed, parts, model) = (&self.bed, &*self.parts, self.tree.model);
        let own = parts.of_tree.iter().map(|c| (None, c));
        let touches = parts.touches.iter();
        let touches = touches.map(|touch| (Some(touch.pushed()), &touch.contact));
        let pair = |(pushed, c): (_, &Contact)| bed.pair_with(pushed, &c.frame.rows());
        pairs.machine.clear();
        pairs.machine.extend(own.chain(touches).map(pair));
        pairs.rows.clear();
        pairs.width = model.nv();
        pairs.n_coordinates = pairs.machine_at + pairs.width;
        for c in 0..pairs.machine.len() {
            (self.tree.parts.system).push_rows(model, c, &mut pairs.rows);
        }
        self.push_diagonal(pairs);
    }

    fn push_diagonal(&self, pairs: &mut BodyPairs<3>) {
        let system = &self.tree.parts.system;
        pairs.beyond.clear();
        (pairs.beyond).extend((0..system.n_contacts()).map(|c| system.beyond(c)));
    }

    fn operator(&self) -> &BlockSparseDelassus {
        let pairs = &self.bed.parts.pairs;
        if !self.parts.touches.is_empty() {
            return self.bed.parts.operator();
        }
        self.parts.operator.get_or_init(|| {
            let mut pairs = pairs.clone();
            self.push_tree(&mut pairs);
            pairs.operator()
        })
    }
}

impl Dynamics for TreeAmongGrains<'_> {
    type T = f64;
    type Configuration = Both;

    fn nv(&self) -> usize {
        self.bed.nv() + self.tree.machine().nv()
    }

    fn set_moved(&self, from: &Both, v: &[f64], h: f64, to: &mut Both) {
        let (v_a, v_b) = self.halves(v);
        self.bed.set_moved(&from.0, v_a, h, &mut to.0);
        self.tree.machine().set_moved(&from.1, v_b, h, &mut to.1);
    }

    fn advance(&self, q: &mut Both, v: &[f64], h: f64) {
        let (v_a, v_b) = self.halves(v);
        self.bed.advance(&mut q.0, v_a, h);
        self.tree.machine().advance(&mut q.1, v_b, h);
    }

    fn is_finite(&self, q: &Both) -> bool {
        self.bed.is_finite(&q.0) && self.tree.machine().is_finite(&q.1)
    }

    fn normalise(&self, q: &mut Both) {
        self.tree.machine().normalise(&mut q.1);
    }

    fn place_middle(&mut self, q: &Both) {
        self.bed.place_middle(&q.0);
        self.tree.machine_mut().place_middle(&q.1);
    }

    fn place_end(&mut self, q: &Both) {
        self.bed.place_end(&q.0);
        self.tree.machine_mut().place_end(&q.1);
    }

    fn update_mass_matrix(&mut self, options: &StepOptions, going: bool, is_first: bool) {
        self.bed.update_mass_matrix(options, going, is_first);
        self.tree
            .machine_mut()
            .update_mass_matrix(options, going, is_first);
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        self.bed.factorise(options) && self.tree.machine_mut().factorise(options)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let ((v_a, v_b), (out_a, out_b)) = (self.halves(v), self.halves_mut(out));
        self.bed.multiply_mass(v_a, out_a);
        self.tree.machine().multiply_mass(v_b, out_b);
    }

    fn turning(
        &mut self,
        options: &StepOptions,
        v: &[f64],
        is_gyroscopic: &mut [bool],
    ) -> Option<f64> {
        let mut of_trees = vec![false; self.tree.machine().n_clusters()];
        let (_, v) = v.split_at(self.bed.nv());
        let turning = self.tree.machine_mut().turning(options, v, &mut of_trees);
        is_gyroscopic[0] = of_trees.contains(&true);
        turning
    }

    fn half_solve(&self, y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        self.bed.half_solve(y_a);
        self.tree.machine().half_solve(y_b);
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        self.bed.half_solve_back(y_a);
        self.tree.machine().half_solve_back(y_b);
    }

    fn close_velocity(&mut self, options: &StepOptions, v_begin: &[f64], v: &[f64], y: &mut [f64]) {
        let n = self.bed.nv();
        self.tree
            .machine_mut()
            .close_velocity(options, &v_begin[n..], &v[n..], &mut y[n..]);
    }

    fn add_loop_impulse(&mut self, out: &mut [f64]) {
        self.tree
            .machine_mut()
            .add_loop_impulse(&mut out[self.bed.nv()..]);
    }

    fn close_end(&mut self, lanes: bool, p: &[f64], q: &mut Both, v: &mut [f64]) -> Option<f64> {
        let [_, p] = self.parts.split(p);
        self.tree
            .machine_mut()
            .close_end(lanes, p, &mut q.1, &mut v[self.bed.nv()..])
    }

    fn mass(&self, _cluster: usize) -> Option<f64> {
        let clusters = 0..self.tree.machine().n_clusters();
        clusters.map(|own| self.tree.machine().mass(own)).sum()
    }

    fn displacement(&self, y: &[f64], _cluster: usize) -> f64 {
        let (y_a, y_b) = self.halves(y);
        let clusters = 0..self.tree.machine().n_clusters();
        let of_trees = clusters.map(|own| self.tree.machine().displacement(y_b, own));
        of_trees.fold(self.bed.displacement(y_a, 0), f64::max)
    }
}

impl Forces for TreeAmongGrains<'_> {
    fn begin_load(&mut self, options: &StepOptions, start: StepStart<'_, Both>, y: &mut [f64]) {
        let (start_a, start_b) = self.starts(start);
        let (y_a, y_b) = self.halves_mut(y);
        self.bed.begin_load(options, start_a, y_a);
        self.tree.machine_mut().begin_load(options, start_b, y_b);
    }

    fn load(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Both>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = (self.halves(v_mean), self.halves_mut(y));
        self.bed.load(options, start_a, v_a, y_a);
        self.tree.machine_mut().load(options, start_b, v_b, y_b);
    }

    fn add_given(&self, options: &StepOptions, impulse: &mut [f64]) {
        self.tree
            .machine()
            .add_given(options, &mut impulse[self.bed.nv()..]);
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Both>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = (self.halves(v_mean), self.halves_mut(y));
        let (own, theirs) = self.halves(impulse);
        (self.bed).load_gyroscopic(options, start_a, v_a, own, y_a);
        self.tree
            .machine_mut()
            .load_gyroscopic(options, start_b, v_b, theirs, y_b);
    }

    fn choose_branches(&mut self, v: &[f64]) {
        let (v_a, v_b) = self.halves(v);
        self.bed.choose_branches(v_a);
        self.tree.machine_mut().choose_branches(v_b);
    }

    fn most_revisions(&self, lane: usize) -> usize {
        let (of_bed, of_tree) = (&self.bed, self.tree.machine());
        of_bed
            .most_revisions(lane)
            .max(of_tree.most_revisions(lane))
    }

    fn unsettled(&mut self, lanes: bool, v_end: &[f64]) -> bool {
        self.tree
            .machine_mut()
            .unsettled(lanes, &v_end[self.bed.nv()..])
    }

    fn revise(&mut self, lanes: bool, v: &[f64], v_end: &[f64]) -> bool {
        let ((v_a, v_b), (end_a, end_b)) = (self.halves(v), self.halves(v_end));
        let has_struck = self.bed.revise(lanes, v_a, end_a);
        self.tree.machine_mut().revise(lanes, v_b, end_b) || has_struck
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Both>,
        v_end: &[f64],
        out: &mut [Work],
    ) {
        let (_, start) = self.starts(start);
        let (_, v_end) = self.halves(v_end);
        let mut of_clusters = vec![Work::default(); self.tree.machine().n_clusters()];
        self.tree
            .machine_mut()
            .work(options, start, v_end, &mut of_clusters);
        let whole = of_clusters.into_iter().reduce(|a, b| a + b);
        out.fill(whole.unwrap_or_default());
    }

    fn accept(&mut self, lanes: bool) {
        self.tree.machine_mut().accept(lanes);
    }
}

impl MechanicalSystem for TreeAmongGrains<'_> {
    type Machine = Self;

    fn machine(&self) -> &Self {
        self
    }

    fn machine_mut(&mut self) -> &mut Self {
        self
    }

    type Contact = CompositeContact;

    const DIMENSION: Dimension = Dimension::Three;

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<CompositeContact>) {
        let v = self.halves(v);
        let CompositeScratch {
            of_grains, of_tree, ..
        } = &mut *self.parts;
        self.bed.detect(v.0, activation, of_grains);
        self.tree.detect(v.1, activation, of_tree);
        // The order of the keys, in which the last step's impulses are looked up.
        of_tree.sort_by_key(UnilateralContact::key);
        let CompositeScratch { touches, near, .. } = &mut *self.parts;
        touches::find(&self.bed, &self.tree, v, activation, near, touches);
        out.clear();
        out.extend(self.parts.listed());
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        self.tree.unknown_ground()
    }

    fn relocate(&mut self, contacts: &mut [CompositeContact]) {
        let parts = &mut *self.parts;
        parts.sort(contacts);
        self.bed.relocate(&mut parts.of_grains);
        self.tree.relocate(&mut parts.of_tree);
        for touch in &mut parts.touches {
            touch.contact.gap = touches::gap_at_end(&self.bed, &self.tree, touch);
        }
        for (place, contact) in contacts.iter_mut().zip(parts.listed()) {
            *place = contact;
        }
    }

    fn friction_coefficient(&self, options: &StepOptions, contact: &CompositeContact) -> f64 {
        match contact {
            CompositeContact::Grains(contact) => self.bed.friction_coefficient(options, contact),
            CompositeContact::Tree(contact) => self.tree.friction_coefficient(options, contact),
            CompositeContact::Touch(_) => self.friction,
        }
    }

    fn assemble(&mut self, contacts: &[CompositeContact], v: &[f64], u: &mut [f64]) {
        let v = self.halves(v);
        let parts = &mut *self.parts;
        parts.sort(contacts);
        parts.operator.take();
        let [u_a, u_b] = parts.split_mut(u);
        self.bed.assemble(&parts.of_grains, v.0, u_a);
        if parts.touches.is_empty() {
            self.tree.assemble(&parts.of_tree, v.1, u_b);
            return;
        }
        (self.tree).assemble_rows(&parts.of_tree, &parts.contacts, v.1);
        u_b.copy_from_slice(&self.tree.parts.system.u);
        let touched = &mut u_b[3 * parts.of_tree.len()..];
        self.subtract_points(&self.parts.touches, v.0, touched);
        let mut pairs = std::mem::take(&mut self.bed.parts.pairs);
        self.push_tree(&mut pairs);
        self.bed.parts.pairs = pairs;
    }

    fn is_immovable(&self, contact: usize) -> bool {
        let own = contact.checked_sub(self.parts.of_grains.len());
        own.is_some_and(|own| self.tree.is_immovable(own))
    }

    fn yields(&self) -> bool {
        self.tree.yields()
    }

    fn compliance(&self, contact: &CompositeContact, v: &[f64]) -> Option<Compliance> {
        match contact {
            CompositeContact::Grains(_) => None,
            CompositeContact::Tree(contact)
            | CompositeContact::Touch(GrainTouch { contact, .. }) => {
                self.tree.compliance(contact, self.halves(v).1)
            }
        }
    }

    fn soften(&mut self, diagonal: impl Iterator<Item = [f64; 3]>) {
        self.tree.soften(diagonal.skip(self.parts.of_grains.len()));
        if !self.parts.touches.is_empty() {
            let mut pairs = std::mem::take(&mut self.bed.parts.pairs);
            self.push_diagonal(&mut pairs);
            self.bed.parts.pairs = pairs;
        }
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let (y_a, y_b) = self.halves(y);
        let parts = &*self.parts;
        let [out_a, out_b] = parts.split_mut(out);
        self.bed.local(y_a, out_a);
        self.tree.local(y_b, out_b);
        for (out, pair) in parts.touched_mut(out_b).zip(self.touching()) {
            for (out, u) in out.iter_mut().zip(pair.local(y_a)) {
                *out += u;
            }
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[CompositeContact], v: &[f64], out: &mut [f64]) {
        let (v_a, v_b) = self.halves(v);
        let (tree, parts) = (&self.tree, &*self.parts);
        let [out_a, out_b] = parts.split_mut(out);
        self.bed.add_local_of_velocity(&parts.of_grains, v_a, out_a);
        tree.add_local_of_velocity(&parts.of_tree, v_b, out_b);
        let first = parts.of_tree.len();
        let (touches, touched) = ((first, &parts.contacts[..]), &mut out_b[3 * first..]);
        let system = &tree.parts.system;
        system.add_local_of_velocity(tree.model, &tree.middle(v_b), touches, touched);
        self.subtract_points(&parts.touches, v_a, touched);
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        let parts = &*self.parts;
        let [p_a, p_b] = parts.split(p);
        self.bed.add_impulses(p_a, y_a);
        self.tree.add_impulses(p_b, y_b);
        for (p, pair) in parts.touched(p_b).zip(self.touching()) {
            pair.add(*p, y_a);
        }
    }

    fn generalized_impulse(&self, _contacts: &[CompositeContact], p: &[f64], out: &mut [f64]) {
        let (out_a, out_b) = self.halves_mut(out);
        let (tree, parts) = (&self.tree, &*self.parts);
        let [p_a, p_b] = parts.split(p);
        let touches = &p_b[3 * parts.of_tree.len()..];
        (self.bed).generalized_impulse(&parts.of_grains, p_a, out_a);
        tree.generalized_impulse(&parts.of_tree, p_b, out_b);
        let mut own = vec![0.0; out_b.len()];
        let poses = &tree.parts.tree.poses_middle;
        generalized_impulse(tree.model, poses, &parts.contacts, touches, &mut own);
        for (out, own) in out_b.iter_mut().zip(own) {
            *out += own;
        }
        for (touch, p) in parts.touches.iter().zip(parts.touched(p_b)) {
            (self.bed).push_grain(touch.pushed(), &touch.contact.frame.rows(), p, out_a);
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(self.operator(), q, mu)
    }

    fn normal_shift(
        &self,
        options: &StepOptions,
        contact: &CompositeContact,
        u_N_before: f64,
    ) -> f64 {
        match contact {
            CompositeContact::Grains(contact) => {
                self.bed.normal_shift(options, contact, u_N_before)
            }
            CompositeContact::Tree(contact) => self.tree.normal_shift(options, contact, u_N_before),
            CompositeContact::Touch(touch) => gap_law(options, touch.gap_start, u_N_before),
        }
    }

    fn solves_to_the_end(&self) -> bool {
        self.bed.solves_to_the_end()
    }

    fn lever(&self, contact: &CompositeContact) -> f64 {
        match contact {
            CompositeContact::Tree(contact) => self.tree.lever(contact),
            CompositeContact::Grains(_) | CompositeContact::Touch(_) => 1.0,
        }
    }

    fn solve(
        &mut self,
        free: Option<(&[f64], &[f64])>,
        (q, mu): (&[f64], &[f64]),
        options: &SolverOptions,
        (p, u): (&mut [f64], &mut [f64]),
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let free = free.map(|(v, y)| (self.halves(v).0, self.halves(y).0));
        let parts = &*self.parts;
        if !parts.touches.is_empty() {
            return (self.bed).solve(free, (q, mu), options, (p, u), workspace);
        }
        let (mu_a, mu_b) = mu.split_at(parts.of_grains.len());
        let ([q_a, q_b], [p_a, p_b]) = (parts.split(q), parts.split_mut(p));
        let [u_a, u_b] = parts.split_mut(u);
        harder(
            &(self.bed).solve(free, (q_a, mu_a), options, (p_a, u_a), workspace),
            &(self.tree).solve(None, (q_b, mu_b), options, (p_b, u_b), workspace),
        )
    }

    fn begin_residual(&mut self, start: StepStart<'_, Both>) {
        let (_, start) = self.starts(start);
        self.tree.begin_residual(start);
    }

    fn residual(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Both>,
        v_end: &[f64],
        v_mean: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((end_a, end_b), (v_a, v_b)) = (self.halves(v_end), self.halves(v_mean));
        let ((own, theirs), (y_a, y_b)) = (self.halves_mut(scratch), self.halves_mut(y));
        (self.bed).residual(options, start_a, end_a, v_a, own, y_a);
        (self.tree).residual(options, start_b, end_b, v_b, theirs, y_b);
    }

    fn add_moments(&self, y: &mut [f64]) {
        let (y_a, _) = self.halves_mut(y);
        self.bed.add_moments(y_a);
    }
}
