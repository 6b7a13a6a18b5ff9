//! Two systems as one: block-diagonal M, the contacts of each, and possibly contacts between them.
//!
//! Each system runs its own code. A [`Coupling`] finds the contacts between the two and maps
//! impulses at them to both systems and back. With the factors of M̂ = diag(M̂_a, M̂_b)
//!
//! ```text
//! Z = diag(F_a, F_b)⁻ᵀ H,        W = Zᵀ Z.
//! ```
//!
//! Without contacts between the two the problem is solved system by system, by each system's own
//! method. Otherwise the coupling solves it, or W is assembled dense, which suits the few contacts
//! of machines rather than the thousands of a bed. A composite of composites holds more than two
//! systems.
//!
//! Decisions about a whole step apply to both systems: whether to repeat it, what the energy audit
//! removes, and whether the last step's impulses serve as a forecast. Apart from that, two systems
//! without a contact between them move as each would alone.

use std::fmt::Debug;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::contact::Activation;
use crate::integrator::{
    MechanicalEnergy, MechanicalSystem, Start, StepOptions, UnilateralContact,
};
use crate::law::newton_impact::rebound;
use crate::problem::{Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

/// An item of the first system, of the second, or between them; in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Of<A, B, K> {
    /// Of the first.
    First(A),
    /// Of the second.
    Second(B),
    /// Between them.
    Between(K),
}

impl<A, B, K> UnilateralContact for Of<A, B, K>
where
    A: UnilateralContact,
    B: UnilateralContact,
    K: UnilateralContact,
{
    type Key = Of<A::Key, B::Key, K::Key>;

    fn key(&self) -> Self::Key {
        match self {
            Self::First(contact) => Of::First(contact.key()),
            Self::Second(contact) => Of::Second(contact.key()),
            Self::Between(contact) => Of::Between(contact.key()),
        }
    }

    fn gap(&self) -> f64 {
        match self {
            Self::First(contact) => contact.gap(),
            Self::Second(contact) => contact.gap(),
            Self::Between(contact) => contact.gap(),
        }
    }
}

/// A contact of a composite.
pub type ContactOf<A, B, K> = Of<
    <A as MechanicalSystem>::Contact,
    <B as MechanicalSystem>::Contact,
    <K as Coupling<A, B>>::Contact,
>;

/// Contacts between two systems.
///
/// Both systems are placed, and their own contacts found and assembled, before the coupling is
/// asked for the same. Local vectors hold its own contacts alone.
pub trait Coupling<A: MechanicalSystem, B: MechanicalSystem> {
    /// A contact between them.
    type Contact: UnilateralContact + Clone;

    /// The middle configurations of a step. By default the placed systems know enough.
    fn place_middle(&mut self, _q: (&A::Configuration, &B::Configuration)) {}

    /// The configurations of the step's end.
    fn place_end(&mut self, _q: (&A::Configuration, &B::Configuration)) {}

    /// Finds the contacts of a step at the middle configurations, and appends them to `out`.
    fn detect(
        &mut self,
        systems: (&A, &B),
        v: (&[f64], &[f64]),
        activation: Activation,
        out: &mut Vec<Self::Contact>,
    );

    /// Measures contacts again at the configurations of the step's end.
    fn relocate(&mut self, systems: (&A, &B), contacts: &mut [Self::Contact]);

    /// μ of a contact.
    fn friction_coefficient(
        &self,
        _systems: (&A, &B),
        options: &StepOptions,
        _contact: &Self::Contact,
    ) -> f64 {
        options.friction_coefficient
    }

    /// See [`MechanicalSystem::normal_shift`].
    fn normal_shift(
        &self,
        _systems: (&A, &B),
        options: &StepOptions,
        _contact: &Self::Contact,
        u_N_before: f64,
    ) -> f64 {
        rebound(options.restitution, u_N_before)
    }

    /// Builds H and Z of the contacts, and `u = Hᵀ v`, m/s. `of_second`: the contacts of the second
    /// system alone.
    fn assemble(
        &mut self,
        systems: (&mut A, &B),
        of_second: &[B::Contact],
        contacts: &[Self::Contact],
        v: (&[f64], &[f64]),
        u: &mut [f64],
    );

    /// `out = Zᵀ y`, m/s.
    fn local(&self, systems: (&A, &B), y: (&[f64], &[f64]), out: &mut [f64]);

    /// `out += Hᵀ v`, m/s.
    fn add_local_of_velocity(
        &self,
        systems: (&A, &B),
        contacts: &[Self::Contact],
        v: (&[f64], &[f64]),
        out: &mut [f64],
    );

    /// `y += Z p`, with p in N s.
    fn add_impulses(&self, systems: (&A, &B), p: &[f64], y: (&mut [f64], &mut [f64]));

    /// `out += H p`, N s and N m s.
    fn add_generalized_impulse(
        &self,
        systems: (&A, &B),
        contacts: &[Self::Contact],
        p: &[f64],
        out: (&mut [f64], &mut [f64]),
    );

    /// Solves all contacts: the first system's, the second's, those between. None if the dense
    /// problem will do. Called only where there are contacts between.
    #[allow(clippy::too_many_arguments)] // a problem and its answer
    fn solve(
        &self,
        _systems: (&A, &B),
        _q: &[f64],
        _mu: &[f64],
        _options: &SolverOptions,
        _p: &mut [f64],
        _u: &mut [f64],
        _workspace: &mut SolverWorkspace,
    ) -> Option<SolveReport> {
        None
    }
}

/// The contact type without values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Never {}

impl UnilateralContact for Never {
    type Key = ();

    fn key(&self) {
        match *self {}
    }

    fn gap(&self) -> f64 {
        match *self {}
    }
}

/// No contacts between the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Apart;

impl<A: MechanicalSystem, B: MechanicalSystem> Coupling<A, B> for Apart {
    type Contact = Never;

    fn detect(
        &mut self,
        _systems: (&A, &B),
        _v: (&[f64], &[f64]),
        _activation: Activation,
        _out: &mut Vec<Never>,
    ) {
    }

    fn relocate(&mut self, _systems: (&A, &B), _contacts: &mut [Never]) {}

    fn assemble(
        &mut self,
        _systems: (&mut A, &B),
        _of_second: &[B::Contact],
        _contacts: &[Never],
        _v: (&[f64], &[f64]),
        _u: &mut [f64],
    ) {
    }

    fn local(&self, _systems: (&A, &B), _y: (&[f64], &[f64]), _out: &mut [f64]) {}

    fn add_local_of_velocity(
        &self,
        _systems: (&A, &B),
        _contacts: &[Never],
        _v: (&[f64], &[f64]),
        _out: &mut [f64],
    ) {
    }

    fn add_impulses(&self, _systems: (&A, &B), _p: &[f64], _y: (&mut [f64], &mut [f64])) {}

    fn add_generalized_impulse(
        &self,
        _systems: (&A, &B),
        _contacts: &[Never],
        _p: &[f64],
        _out: (&mut [f64], &mut [f64]),
    ) {
    }
}

/// Scratch of a composite: contacts sorted by system, and the dense W.
#[derive(Clone, Debug)]
pub struct CompositeParts<A, B, K> {
    first: Vec<A>,
    second: Vec<B>,
    between: Vec<K>,
    W: OnceLock<Vec<f64>>,
}

impl<A, B, K> Default for CompositeParts<A, B, K> {
    fn default() -> Self {
        Self {
            first: Vec::new(),
            second: Vec::new(),
            between: Vec::new(),
            W: OnceLock::new(),
        }
    }
}

impl<A: Clone, B: Clone, K: Clone> CompositeParts<A, B, K> {
    /// Sorts contacts by system.
    fn sort(&mut self, contacts: &[Of<A, B, K>]) {
        self.first.clear();
        self.second.clear();
        self.between.clear();
        for contact in contacts {
            match contact {
                Of::First(contact) => self.first.push(contact.clone()),
                Of::Second(contact) => self.second.push(contact.clone()),
                Of::Between(contact) => self.between.push(contact.clone()),
            }
        }
    }

    /// Merges the lists.
    fn listed(&self) -> impl Iterator<Item = Of<A, B, K>> + '_ {
        let first = self.first.iter().cloned().map(Of::First);
        let second = self.second.iter().cloned().map(Of::Second);
        first
            .chain(second)
            .chain(self.between.iter().cloned().map(Of::Between))
    }
}

/// Scratch of a composite of these systems.
pub type PartsOf<A, B, K> = CompositeParts<
    <A as MechanicalSystem>::Contact,
    <B as MechanicalSystem>::Contact,
    <K as Coupling<A, B>>::Contact,
>;

/// Two systems and their coupling.
pub struct Composite<'a, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A, B>,
{
    /// The first.
    pub first: A,
    /// The second.
    pub second: B,
    /// The coupling.
    pub coupling: K,
    /// Scratch.
    pub parts: &'a mut PartsOf<A, B, K>,
}

impl<A, B, K> Composite<'_, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A, B>,
    A::Contact: Clone,
    B::Contact: Clone,
{
    const D: usize = {
        assert!(
            A::DIMENSION.components() == B::DIMENSION.components(),
            "both systems in the plane or both in space"
        );
        A::DIMENSION.components()
    };

    fn systems(&self) -> (&A, &B) {
        (&self.first, &self.second)
    }

    /// Numbers of local components of each system's contacts.
    fn counts(&self) -> [usize; 2] {
        [
            Self::D * self.parts.first.len(),
            Self::D * self.parts.second.len(),
        ]
    }

    /// Local components of the first system's contacts, of the second's, and of those between.
    fn split<'v>(&self, local: &'v [f64]) -> [&'v [f64]; 3] {
        let [a, b] = self.counts();
        [&local[..a], &local[a..a + b], &local[a + b..]]
    }

    fn split_mut<'v>(&self, local: &'v mut [f64]) -> [&'v mut [f64]; 3] {
        let [a, b] = self.counts();
        let (first, rest) = local.split_at_mut(a);
        let (second, between) = rest.split_at_mut(b);
        [first, second, between]
    }

    /// The part of each system of a vector, and of one to be written.
    #[allow(clippy::type_complexity)] // two pairs
    fn halves<'v>(
        &self,
        v: &'v [f64],
        out: &'v mut [f64],
    ) -> ((&'v [f64], &'v [f64]), (&'v mut [f64], &'v mut [f64])) {
        let n = self.first.nv();
        (v.split_at(n), out.split_at_mut(n))
    }

    /// Where a step begins, of each system.
    fn starts<'q>(
        &self,
        start: Start<'q, (A::Configuration, B::Configuration)>,
    ) -> (Start<'q, A::Configuration>, Start<'q, B::Configuration>) {
        let (q_a, q_b) = start.configuration;
        let (v_a, v_b) = start.v.split_at(self.first.nv());
        (
            Start {
                configuration: q_a,
                v: v_a,
            },
            Start {
                configuration: q_b,
                v: v_b,
            },
        )
    }

    /// W (row-major): column j is the response to a unit impulse at j.
    fn operator(&self) -> &[f64] {
        self.parts.W.get_or_init(|| {
            let [a, b] = self.counts();
            let n = a + b + Self::D * self.parts.between.len();
            let (mut W, mut p) = (vec![0.0; n * n], vec![0.0; n]);
            let (mut y, mut column) = (vec![0.0; self.nv()], vec![0.0; n]);
            for j in 0..n {
                p[j] = 1.0;
                y.fill(0.0);
                self.add_impulses(&p, &mut y);
                self.local(&y, &mut column);
                p[j] = 0.0;
                for (i, entry) in column.iter().enumerate() {
                    W[i * n + j] = *entry;
                }
            }
            W
        })
    }
}

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

impl<A, B, K> MechanicalSystem for Composite<'_, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A, B>,
    A::Contact: Clone,
    B::Contact: Clone,
{
    type Configuration = (A::Configuration, B::Configuration);
    type Contact = ContactOf<A, B, K>;

    const DIMENSION: Dimension = A::DIMENSION;

    fn nv(&self) -> usize {
        self.first.nv() + self.second.nv()
    }

    fn set_moved(
        &self,
        from: &Self::Configuration,
        v: &[f64],
        h: f64,
        to: &mut Self::Configuration,
    ) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        self.first.set_moved(&from.0, v_a, h, &mut to.0);
        self.second.set_moved(&from.1, v_b, h, &mut to.1);
    }

    fn advance(&self, q: &mut Self::Configuration, v: &[f64], h: f64) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        self.first.advance(&mut q.0, v_a, h);
        self.second.advance(&mut q.1, v_b, h);
    }

    fn is_finite(&self, q: &Self::Configuration) -> bool {
        self.first.is_finite(&q.0) && self.second.is_finite(&q.1)
    }

    fn normalise(&self, q: &mut Self::Configuration) {
        self.first.normalise(&mut q.0);
        self.second.normalise(&mut q.1);
    }

    fn place_middle(&mut self, q: &Self::Configuration) {
        self.first.place_middle(&q.0);
        self.second.place_middle(&q.1);
        self.coupling.place_middle((&q.0, &q.1));
    }

    fn place_end(&mut self, q: &Self::Configuration) {
        self.first.place_end(&q.0);
        self.second.place_end(&q.1);
        self.coupling.place_end((&q.0, &q.1));
    }

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<Self::Contact>) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        let parts = &mut *self.parts;
        self.first.detect(v_a, activation, &mut parts.first);
        self.second.detect(v_b, activation, &mut parts.second);
        // The order of the keys, in which the last step's impulses are looked up.
        parts.second.sort_by_key(UnilateralContact::key);
        parts.between.clear();
        let systems = (&self.first, &self.second);
        self.coupling
            .detect(systems, (v_a, v_b), activation, &mut parts.between);
        out.clear();
        out.extend(parts.listed());
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        let first = self.first.unknown_ground();
        first.or_else(|| self.second.unknown_ground())
    }

    fn relocate(&mut self, contacts: &mut [Self::Contact]) {
        let parts = &mut *self.parts;
        parts.sort(contacts);
        self.first.relocate(&mut parts.first);
        self.second.relocate(&mut parts.second);
        let systems = (&self.first, &self.second);
        self.coupling.relocate(systems, &mut parts.between);
        for (place, contact) in contacts.iter_mut().zip(parts.listed()) {
            *place = contact;
        }
    }

    fn friction_coefficient(&self, options: &StepOptions, contact: &Self::Contact) -> f64 {
        match contact {
            Of::First(contact) => self.first.friction_coefficient(options, contact),
            Of::Second(contact) => self.second.friction_coefficient(options, contact),
            Of::Between(contact) => {
                let systems = self.systems();
                self.coupling
                    .friction_coefficient(systems, options, contact)
            }
        }
    }

    fn update_mass_matrix(&mut self, options: &StepOptions) {
        self.first.update_mass_matrix(options);
        self.second.update_mass_matrix(options);
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        self.first.factorise(options) && self.second.factorise(options)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let ((v_a, v_b), (out_a, out_b)) = self.halves(v, out);
        self.first.multiply_mass(v_a, out_a);
        self.second.multiply_mass(v_b, out_b);
    }

    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = self.halves(v_mean, y);
        self.first.load(options, start_a, v_a, y_a);
        self.second.load(options, start_b, v_b, y_b);
    }

    fn is_gyroscopic(&self, options: &StepOptions, v: &[f64]) -> bool {
        let (v_a, v_b) = v.split_at(self.first.nv());
        self.first.is_gyroscopic(options, v_a) || self.second.is_gyroscopic(options, v_b)
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = self.halves(v_mean, y);
        let (impulse_a, impulse_b) = impulse.split_at(v_a.len());
        self.first
            .load_gyroscopic(options, start_a, v_a, impulse_a, y_a);
        self.second
            .load_gyroscopic(options, start_b, v_b, impulse_b, y_b);
    }

    fn choose_branches(&mut self, start: Start<'_, Self::Configuration>) {
        let (start_a, start_b) = self.starts(start);
        self.first.choose_branches(start_a);
        self.second.choose_branches(start_b);
    }

    fn revise(&mut self, start: Start<'_, Self::Configuration>, v_end: &[f64]) -> bool {
        let (start_a, start_b) = self.starts(start);
        let (v_a, v_b) = v_end.split_at(self.first.nv());
        let is_new = [
            self.first.revise(start_a, v_a),
            self.second.revise(start_b, v_b),
        ];
        is_new.contains(&true)
    }

    /// None if one of the two is not audited.
    fn energy(
        &mut self,
        options: &StepOptions,
        q: &Self::Configuration,
        v: &[f64],
    ) -> Option<MechanicalEnergy> {
        let (v_a, v_b) = v.split_at(self.first.nv());
        let a = self.first.energy(options, &q.0, v_a)?;
        let b = self.second.energy(options, &q.1, v_b)?;
        Some(MechanicalEnergy {
            kinetic: a.kinetic + b.kinetic,
            potential: a.potential + b.potential,
            // No single velocity carries the total momentum.
            momentum: nalgebra::Vector3::zeros(),
            mass: a.mass + b.mass,
        })
    }

    fn turning(&self, v: &[f64]) -> f64 {
        let (v_a, v_b) = v.split_at(self.first.nv());
        self.first.turning(v_a).max(self.second.turning(v_b))
    }

    fn conserves_momenta(&self) -> bool {
        self.first.conserves_momenta() && self.second.conserves_momenta()
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_end: &[f64],
    ) -> f64 {
        let (start_a, start_b) = self.starts(start);
        let (v_a, v_b) = v_end.split_at(self.first.nv());
        self.first.work(options, start_a, v_a) + self.second.work(options, start_b, v_b)
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> f64 {
        let (start_a, start_b) = self.starts(start);
        let (v_a, v_b) = v_end.split_at(self.first.nv());
        let (d_a, d_b) = displacement.split_at(self.first.nv());
        let first = (self.first).work_of_displacement(options, start_a, v_a, d_a);
        first + (self.second).work_of_displacement(options, start_b, v_b, d_b)
    }

    fn accept(&mut self) {
        self.first.accept();
        self.second.accept();
    }

    fn begin_balance(&mut self, start: Start<'_, Self::Configuration>) {
        let (start_a, start_b) = self.starts(start);
        self.first.begin_balance(start_a);
        self.second.begin_balance(start_b);
    }

    fn load_at_end(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_end: &[f64],
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let (end_a, end_b) = v_end.split_at(self.first.nv());
        let ((v_a, v_b), (y_a, y_b)) = self.halves(v_mean, y);
        self.first.load_at_end(options, start_a, end_a, v_a, y_a);
        self.second.load_at_end(options, start_b, end_b, v_b, y_b);
    }

    fn balance(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_end: &[f64],
        v_mean: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let (end_a, end_b) = v_end.split_at(self.first.nv());
        let (scratch_a, scratch_b) = scratch.split_at_mut(end_a.len());
        let ((v_a, v_b), (y_a, y_b)) = self.halves(v_mean, y);
        self.first
            .balance(options, start_a, end_a, v_a, scratch_a, y_a);
        self.second
            .balance(options, start_b, end_b, v_b, scratch_b, y_b);
    }

    fn half_solve(&self, y: &mut [f64]) {
        let (y_a, y_b) = y.split_at_mut(self.first.nv());
        self.first.half_solve(y_a);
        self.second.half_solve(y_b);
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        let (y_a, y_b) = y.split_at_mut(self.first.nv());
        self.first.half_solve_back(y_a);
        self.second.half_solve_back(y_b);
    }

    fn assemble(&mut self, contacts: &[Self::Contact], v: &[f64], u: &mut [f64]) {
        self.parts.sort(contacts);
        let (v_a, v_b) = v.split_at(self.first.nv());
        let [a, b] = self.counts();
        let (u_a, rest) = u.split_at_mut(a);
        let (u_b, between) = rest.split_at_mut(b);
        let parts = &mut *self.parts;
        parts.W.take();
        self.first.assemble(&parts.first, v_a, u_a);
        self.second.assemble(&parts.second, v_b, u_b);
        self.coupling.assemble(
            (&mut self.first, &self.second),
            &parts.second,
            &parts.between,
            (v_a, v_b),
            between,
        );
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let (y_a, y_b) = y.split_at(self.first.nv());
        let [out_a, out_b, between] = self.split_mut(out);
        self.first.local(y_a, out_a);
        self.second.local(y_b, out_b);
        self.coupling.local(self.systems(), (y_a, y_b), between);
    }

    fn add_local_of_velocity(&self, _contacts: &[Self::Contact], v: &[f64], out: &mut [f64]) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        let [out_a, out_b, between] = self.split_mut(out);
        let parts = &*self.parts;
        self.first.add_local_of_velocity(&parts.first, v_a, out_a);
        self.second.add_local_of_velocity(&parts.second, v_b, out_b);
        let systems = self.systems();
        self.coupling
            .add_local_of_velocity(systems, &parts.between, (v_a, v_b), between);
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let [p_a, p_b, between] = self.split(p);
        let (y_a, y_b) = y.split_at_mut(self.first.nv());
        self.first.add_impulses(p_a, y_a);
        self.second.add_impulses(p_b, y_b);
        let systems = self.systems();
        self.coupling.add_impulses(systems, between, (y_a, y_b));
    }

    fn generalized_impulse(&self, _contacts: &[Self::Contact], p: &[f64], out: &mut [f64]) {
        let [p_a, p_b, between] = self.split(p);
        let (out_a, out_b) = out.split_at_mut(self.first.nv());
        let parts = &*self.parts;
        self.first.generalized_impulse(&parts.first, p_a, out_a);
        self.second.generalized_impulse(&parts.second, p_b, out_b);
        let systems = self.systems();
        self.coupling
            .add_generalized_impulse(systems, &parts.between, between, (out_a, out_b));
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Self::DIMENSION, self.operator(), q, mu)
    }

    fn normal_shift(&self, options: &StepOptions, contact: &Self::Contact, u_N_before: f64) -> f64 {
        match contact {
            Of::First(contact) => self.first.normal_shift(options, contact, u_N_before),
            Of::Second(contact) => self.second.normal_shift(options, contact, u_N_before),
            Of::Between(contact) => {
                let systems = self.systems();
                self.coupling
                    .normal_shift(systems, options, contact, u_N_before)
            }
        }
    }

    fn solves_to_the_end(&self) -> bool {
        self.first.solves_to_the_end() && self.second.solves_to_the_end()
    }

    fn solve(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let is_apart = self.parts.between.is_empty();
        if !is_apart {
            let systems = self.systems();
            let coupled = self
                .coupling
                .solve(systems, q, mu, options, p, u, workspace);
            return coupled
                .unwrap_or_else(|| solve(&self.problem(q, mu), options, p, u, workspace));
        }
        let (mu_a, mu_b) = mu.split_at(self.parts.first.len());
        let [q_a, q_b, _] = self.split(q);
        let [p_a, p_b, _] = self.split_mut(p);
        let [u_a, u_b, _] = self.split_mut(u);
        harder(
            &self.first.solve(q_a, mu_a, options, p_a, u_a, workspace),
            &self.second.solve(q_b, mu_b, options, p_b, u_b, workspace),
        )
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let (y_a, y_b) = y.split_at(self.first.nv());
        (self.first.displacement(y_a)).max(self.second.displacement(y_b))
    }
}
