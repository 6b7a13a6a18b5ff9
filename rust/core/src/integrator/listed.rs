//! One system with its contacts in a list, as the only lane of [`Systems`].

use super::data::Data;
use super::dynamics::Dynamics;
use super::grouped::Grouped;
use super::island::Island;
use super::local::Local;
use super::mechanical_system::{
    ConfigurationOf, KeyOf, LocalOf, MechanicalSystem, UnilateralContact,
};
use super::options::StepOptions;
use super::report::StepReport;
use super::systems::{MemoryOf, Systems};
use crate::contact::Activation;
use crate::law::compliance::{Compliance, Yielding};
use crate::problem::Redundancy;
use crate::scalar::{Single, Vec3};
use crate::solver::SolverWorkspace;

/// A system in a step.
pub(super) struct Listed<'a, S: MechanicalSystem> {
    pub system: &'a mut S,
    pub options: &'a StepOptions,
    pub list: &'a mut List<S::Contact>,
}

/// The contacts of a step, and scratch of their problems.
#[derive(Clone, Debug)]
pub(super) struct List<C: UnilateralContact> {
    pub contacts: Vec<C>,
    pub mu: Vec<f64>,
    /// Local velocities before the step, m/s.
    pub u_before: Vec<C::Local>,
    /// The first cluster of each cluster's group, and whether groups have several.
    leaders: Vec<usize>,
    is_joined: bool,
    /// Cluster of each contact that touches no other; empty if the system is one cluster.
    clusters: Vec<Option<usize>>,
    /// Leader of each contact's group.
    group_leaders: Vec<usize>,
    /// Leaders of the groups with contacts, ascending.
    pub groups: Vec<usize>,
    /// By leader: whether an impact without elastic answer is taken as inelastic, by these options.
    pub is_inelastic: Vec<bool>,
    pub inelastic: Option<StepOptions>,
    /// By leader: whether there is no other way to take the step.
    pub is_last: Vec<bool>,
    pub island: Island,
    pub solver: SolverWorkspace,
    pub redundancy: Redundancy,
    /// Whether impulses that the motion leaves open stay as the solver finds them.
    pub leaves_open: bool,
    /// Work of the step's solves so far, in the solver's unit.
    pub work_spent: u64,
    /// Whether a step that is not solved is taken in halves.
    pub may_halve: bool,
}

/// A friction-contact problem with its answer, by contact.
#[derive(Clone, Debug)]
pub(super) struct Posed<L> {
    pub q: Vec<L>,
    pub p: Vec<L>,
    pub u: Vec<L>,
    /// What the solves say.
    pub report: StepReport,
}

/// A problem of a system's contacts.
pub(super) type PosedOf<S> = Posed<LocalOf<S>>;

/// The data of a system's step.
pub(super) type ListedData<S> = Data<f64, ConfigurationOf<S>, LocalOf<S>, KeyOf<S>>;

impl<L: Local<f64>> Posed<L> {
    pub fn resize(&mut self, n: usize) {
        for all in [&mut self.q, &mut self.p, &mut self.u] {
            all.resize(n, L::splat(0.0));
        }
    }
}

impl<C: UnilateralContact> List<C> {
    /// Room for n contacts.
    pub fn with_capacity(n: usize) -> Self {
        Self {
            contacts: Vec::with_capacity(n),
            mu: Vec::with_capacity(n),
            u_before: Vec::with_capacity(n),
            leaders: Vec::new(),
            is_joined: false,
            clusters: Vec::new(),
            group_leaders: Vec::new(),
            groups: Vec::new(),
            is_inelastic: Vec::new(),
            is_last: Vec::new(),
            inelastic: None,
            island: Island::default(),
            solver: SolverWorkspace::default(),
            redundancy: Redundancy::default(),
            leaves_open: false,
            work_spent: 0,
            may_halve: false,
        }
    }

    /// Begins a step of a system with n clusters.
    pub fn begin(&mut self, n: usize) {
        self.work_spent = 0;
        self.leaves_open = false; // a panic may have left it
        self.island.begin(n);
    }

    /// Leader of the group of a contact.
    pub fn group_leader_of(&self, i: usize) -> usize {
        self.group_leaders.get(i).copied().unwrap_or(0)
    }

    /// Number of the clusters.
    pub fn n_clusters(&self) -> usize {
        self.leaders.len()
    }

    /// Leader of the group of a cluster.
    pub fn leader_of(&self, cluster: usize) -> usize {
        self.leaders[cluster]
    }
}

impl<S: MechanicalSystem> Listed<'_, S> {
    /// Finds which clusters the contacts join.
    fn find_groups(&mut self) {
        let n = self.machine().n_clusters();
        let list = &mut *self.list;
        list.leaders.clear();
        list.leaders.extend(0..n);
        list.is_joined = false;
        list.is_inelastic.clear();
        list.is_inelastic.resize(n, false);
        list.clusters.clear();
        list.group_leaders.clear();
        list.groups.clear();
        if n == 1 {
            list.groups.extend((!list.contacts.is_empty()).then_some(0));
            return;
        }
        for contact in &list.contacts {
            let both = self.system.clusters_of(&contact.key());
            let [a, b] = both.map(|own| list.leaders[own]);
            let is_alone = both[0] == both[1] && !contact.is_internal();
            list.clusters.push(is_alone.then_some(both[0]));
            if a != b {
                list.is_joined = true;
                for own in &mut list.leaders {
                    if [a, b].contains(own) {
                        *own = a.min(b);
                    }
                }
            }
        }
        for contact in &list.contacts {
            let [cluster, _] = self.system.clusters_of(&contact.key());
            let leader = list.leaders[cluster];
            list.group_leaders.push(leader);
            if let Err(place) = list.groups.binary_search(&leader) {
                list.groups.insert(place, leader);
            }
        }
    }

    /// The options by which a contact's impact is taken.
    fn law_of(&self, i: usize) -> &StepOptions {
        match &self.list.inelastic {
            Some(law) if self.list.is_inelastic[self.list.group_leader_of(i)] => law,
            _ => self.options,
        }
    }

    /// Normal shift of a rigid contact, m/s.
    pub fn shift(&self, i: usize) -> f64 {
        let before = self.list.u_before[i][0];
        (self.system).normal_shift(self.law_of(i), &self.list.contacts[i], before)
    }

    /// Friction coefficients of all contacts.
    pub fn set_friction(&mut self) {
        let list = &mut *self.list;
        list.mu.clear();
        for contact in &list.contacts {
            let mu = self.system.friction_coefficient(self.options, contact);
            list.mu.push(mu);
        }
    }
}

impl<S: MechanicalSystem> Systems for Listed<'_, S> {
    type T = f64;
    type Configuration = ConfigurationOf<S>;
    type Machine = S::Machine;
    type Local = LocalOf<S>;
    type Key = KeyOf<S>;
    type Contacts = List<S::Contact>;
    type Problems = Posed<Self::Local>;

    const RELISTS: bool = true;

    fn machine(&self) -> &S::Machine {
        self.system.machine()
    }

    fn machine_mut(&mut self) -> &mut S::Machine {
        self.system.machine_mut()
    }

    fn gravity(&self) -> Vec3<f64> {
        self.options.gravity.into()
    }

    fn contacts(&self) -> &List<S::Contact> {
        self.list
    }

    fn n_places(&self) -> usize {
        self.list.contacts.len()
    }

    fn detect(
        &mut self,
        options: &StepOptions,
        _: (&ConfigurationOf<S>, &ConfigurationOf<S>),
        v: &[f64],
        _: bool,
    ) -> bool {
        let (h, theta) = (options.time_step, options.theta);
        let (gravity, measured) = (options.gravity.into(), (1.0 - theta) * h);
        let activation = Activation::of_step(gravity, h, options.forecast, measured);
        self.find_contacts(v, activation);
        self.system.relocate(&mut self.list.contacts);
        false
    }

    fn recall(
        &mut self,
        _: usize,
        memory: &MemoryOf<Self>,
        problems: &mut Posed<Self::Local>,
        is_same: &mut [bool],
    ) {
        let list = &*self.list;
        let d = <Self::Local as Local<f64>>::N;
        problems.resize(list.contacts.len());
        memory.recall(&list.contacts, d, Local::flat_mut(&mut problems.p));
        if let [only] = is_same {
            *only = memory.is_of(&list.contacts);
            return;
        }
        is_same.fill(true);
        for (i, contact) in list.contacts.iter().enumerate() {
            let wanted = contact.key();
            if !memory.impulses.iter().any(|(key, _)| *key == wanted) {
                is_same[list.group_leader_of(i)] = false;
            }
        }
        for (known, _) in &memory.impulses {
            if !list.contacts.iter().any(|contact| contact.key() == *known) {
                for cluster in self.system.clusters_of(known) {
                    is_same[cluster] = false;
                }
            }
        }
        list.intersect(is_same);
    }

    fn read_start(&self, problems: &Posed<Self::Local>, p: &mut [Self::Local]) {
        p.copy_from_slice(&problems.p);
    }

    fn assemble(&mut self, v: &[f64]) {
        let list = &mut *self.list;
        list.u_before.resize(list.contacts.len(), Local::splat(0.0));
        let u = Local::flat_mut(&mut list.u_before);
        self.system.assemble(&list.contacts, v, u);
    }

    fn u_before(&self) -> &[Self::Local] {
        &self.list.u_before
    }

    fn lever(&self, i: usize) -> Option<f64> {
        Some(self.system.lever(&self.list.contacts[i]))
    }

    fn yields(&self) -> bool {
        self.system.yields()
    }

    fn compliance(&self, i: usize, v: &[f64]) -> (Option<Compliance>, bool) {
        let found = self.system.compliance(&self.list.contacts[i], v);
        (found, found.is_some())
    }

    fn remembers(&self, _: usize, memory: &MemoryOf<Self>, cluster: usize) -> bool {
        let mut known = memory.impulses.iter();
        known.any(|(key, _)| self.system.clusters_of(key).contains(&cluster))
    }

    fn own_cluster(&self, i: usize, _: usize) -> usize {
        self.system.clusters_of(&self.list.contacts[i].key())[0]
    }

    fn restitution(&self, options: &StepOptions, i: usize) -> f64 {
        let contact = &self.list.contacts[i];
        let shift = |u_N| self.system.normal_shift(options, contact, u_N);
        shift(1.0) - shift(0.0)
    }

    fn soften(&mut self, laws: &[Yielding]) {
        self.system.soften(laws.iter().map(|law| law.diagonal));
    }

    fn immovable(&self, i: usize) -> bool {
        self.system.is_immovable(i)
    }

    fn local(&self, y: &[f64], u: &mut [Self::Local]) {
        let flat = Self::Local::flat_mut(u);
        self.system.local(y, flat);
        for (u, before) in flat.iter_mut().zip(Self::Local::flat(&self.list.u_before)) {
            *u += before;
        }
    }

    fn add_impulses(&self, lanes: bool, p: &[Self::Local], y: &mut [f64]) {
        if lanes {
            self.system.add_impulses(Local::flat(p), y);
        }
    }

    fn add_moments(&self, y: &mut [f64]) {
        self.system.add_moments(y);
    }

    fn generalized_impulse(&self, lanes: bool, p: &[Self::Local], out: &mut [f64]) {
        if lanes {
            let p = Local::flat(p);
            self.system.generalized_impulse(&self.list.contacts, p, out);
        } else {
            out.fill(0.0);
        }
    }

    fn add_shifts(&self, _: &StepOptions, sign: f64, laws: &[Yielding], u: &mut [Self::Local]) {
        for (i, u) in u.iter_mut().enumerate() {
            if !laws.get(i).is_some_and(Yielding::is_soft) {
                u[0] += sign * self.shift(i);
            }
        }
    }

    fn pose(
        &mut self,
        options: &StepOptions,
        (q, _): (&[Self::Local], &[f64]),
        _: &[Self::Local],
        _: &[bool],
        _: bool,
        problems: &mut Posed<Self::Local>,
    ) {
        self.set_friction();
        problems.q.copy_from_slice(q);
        if !options.warm_start {
            problems.p.fill(Local::splat(0.0));
        }
    }

    fn take_answers(
        &mut self,
        _: &StepOptions,
        _: bool,
        problems: &mut Posed<Self::Local>,
        reports: &mut [StepReport],
        memories: &mut [MemoryOf<Self>],
    ) -> bool {
        let list = &*self.list;
        let n = list.contacts.len();
        reports[0] = StepReport {
            n_contacts: n,
            immovable_contacts: (0..n).filter(|i| self.system.is_immovable(*i)).count(),
            steps: reports[0].steps,
            retaken: reports[0].retaken + problems.report.retaken,
            ..problems.report
        };
        let d = <Self::Local as Local<f64>>::N;
        memories[0].remember(&list.contacts, d, Local::flat(&problems.p));
        problems.report.is_converged()
    }

    fn read(&self, problems: &Posed<Self::Local>, p: &mut [Self::Local], u: &mut [Self::Local]) {
        p.copy_from_slice(&problems.p);
        u.copy_from_slice(&problems.u);
    }

    fn place_in_memory(&self, i: usize, _: usize) -> usize {
        i
    }

    fn norms(
        &self,
        problems: &Posed<Self::Local>,
        (leader, _): (usize, usize),
        u: &[Self::Local],
    ) -> Option<[f64; 2]> {
        let (mut lost, mut free) = (0.0, 0.0);
        for i in (0..u.len()).filter(|i| self.list.group_leader_of(*i) == leader) {
            if problems.p[i][0] > 0.0 {
                lost += u[i][0] * u[i][0];
            }
            for k in 0..Self::Local::N {
                free += problems.q[i][k] * problems.q[i][k];
            }
        }
        Some([lost, free])
    }

    fn pose_gaps(
        &mut self,
        gaps: &[Self::Local],
        is_deep: &[bool],
        _: &mut [Self::Local],
        problems: &mut Posed<Self::Local>,
    ) {
        problems.resize(gaps.len());
        problems.q.fill(Local::splat(0.0));
        problems.p.fill(Local::splat(0.0));
        for (i, gap) in gaps.iter().enumerate() {
            if is_deep[self.list.group_leader_of(i)] {
                problems.q[i] = *gap;
            }
        }
        problems.u.copy_from_slice(&problems.q);
        problems.report = StepReport::default();
    }

    fn take_displacements(
        &mut self,
        _: &StepOptions,
        _: bool,
        problems: &mut Posed<Self::Local>,
        _: &[bool],
        reports: &mut [StepReport],
        farthest: &mut [f64],
    ) -> bool {
        let (own, found) = (&mut reports[0], &problems.report);
        own.iterations += found.iterations;
        own.factorisations += found.factorisations;
        own.pivots += found.pivots;
        own.budget_exhausted |= found.budget_exhausted;
        own.residual = own.residual.max(found.residual);
        if !found.is_converged() {
            own.status = found.status;
        }
        for (i, (u, q)) in problems.u.iter().zip(&problems.q).enumerate() {
            let lever = self.system.lever(&self.list.contacts[i]);
            let most = &mut farthest[self.list.group_leader_of(i)];
            for k in 0..Self::Local::N {
                *most = most.max((u[k] - q[k]).abs() * lever);
            }
        }
        false
    }

    fn read_pushes(&self, problems: &Posed<Self::Local>, pushes: &mut [Self::Local]) {
        pushes.copy_from_slice(&problems.p);
    }
}

impl<S: MechanicalSystem> Listed<'_, S> {
    /// Finds the contacts of the step where the bodies are placed, and their groups.
    pub fn find_contacts(&mut self, v: &[f64], activation: Activation) {
        self.system.detect(v, activation, &mut self.list.contacts);
        self.find_groups();
        self.list.inelastic = None;
    }
}

impl<C: UnilateralContact> Grouped<f64> for List<C> {
    fn token(&self) -> Single {
        Single::Baseline
    }

    fn used(&self) -> impl Iterator<Item = usize> {
        0..self.contacts.len()
    }

    fn active(&self, _: usize) -> bool {
        true
    }

    fn gap(&self, i: usize) -> f64 {
        self.contacts[i].gap()
    }

    fn is_with_world(&self, i: usize) -> bool {
        !self.contacts[i].is_internal()
    }

    fn n_clusters(&self) -> usize {
        self.leaders.len()
    }

    fn joined(&self) -> u32 {
        u32::from(self.is_joined)
    }

    fn leader(&self, cluster: usize, _: usize) -> usize {
        self.leaders[cluster]
    }

    fn cluster_of(&self, i: usize) -> Option<usize> {
        self.clusters.get(i).copied().unwrap_or(Some(0))
    }

    fn group_leader(&self, i: usize, _: usize) -> usize {
        self.group_leader_of(i)
    }
}
