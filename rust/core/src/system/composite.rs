//! Two systems as one: block-diagonal M, the contacts of each, and possibly contacts between them.
//!
//! Each system runs its own code. A [`Coupling`] finds the contacts between the two and provides
//! their rows of Hᵀ, which span both systems. With the factors of M̂ = diag(M̂_a, M̂_b)
//!
//! ```text
//! Z = diag(F_a, F_b)⁻ᵀ H,        W = Zᵀ Z.
//! ```
//!
//! Without contacts between the two the problem is solved system by system, by each system's own
//! method. Otherwise W is assembled dense, which suits the few contacts of machines rather than the
//! thousands of a bed. A composite of composites holds more than two systems.
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
    <K as Coupling<
        <A as MechanicalSystem>::Configuration,
        <B as MechanicalSystem>::Configuration,
    >>::Contact,
>;

/// Finds the contacts between two systems of configurations A and B. Normals point into the first.
pub trait Coupling<A, B> {
    /// A contact between them.
    type Contact: UnilateralContact + Clone;

    /// Finds the contacts of a step at the middle configurations, and appends them to `out`.
    fn detect(
        &self,
        q: (&A, &B),
        v: (&[f64], &[f64]),
        activation: Activation,
        out: &mut Vec<Self::Contact>,
    );

    /// Measures a contact again at the configurations of the step's end.
    fn relocate(&self, q: (&A, &B), contact: &mut Self::Contact);

    /// Rows of Hᵀ of a contact, d for each system, row-major: (d × nv) and
    /// (d × nv), which come as zeros.
    fn rows(&self, q: (&A, &B), contact: &Self::Contact, rows: (&mut [f64], &mut [f64]));

    /// μ of a contact.
    fn friction_coefficient(&self, options: &StepOptions, _contact: &Self::Contact) -> f64 {
        options.friction_coefficient
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

impl<A, B> Coupling<A, B> for Apart {
    type Contact = Never;

    fn detect(
        &self,
        _q: (&A, &B),
        _v: (&[f64], &[f64]),
        _activation: Activation,
        _out: &mut Vec<Never>,
    ) {
    }

    fn relocate(&self, _q: (&A, &B), contact: &mut Never) {
        match *contact {}
    }

    fn rows(&self, _q: (&A, &B), contact: &Never, _rows: (&mut [f64], &mut [f64])) {
        match *contact {}
    }
}

/// Scratch of a composite: contacts sorted by system, and the rows of those between.
#[derive(Clone, Debug)]
pub struct CompositeParts<Q, A, B, K> {
    middle: Option<Q>,
    end: Option<Q>,
    first: Vec<A>,
    second: Vec<B>,
    between: Vec<K>,
    /// Rows of Hᵀ of the contacts between (d × nv each).
    H: Vec<f64>,
    /// Their rows of Zᵀ.
    Z: Vec<f64>,
    /// Rows of one contact, of each system.
    rows: [Vec<f64>; 2],
    W: OnceLock<Vec<f64>>,
}

impl<Q, A, B, K> Default for CompositeParts<Q, A, B, K> {
    fn default() -> Self {
        Self {
            middle: None,
            end: None,
            first: Vec::new(),
            second: Vec::new(),
            between: Vec::new(),
            H: Vec::new(),
            Z: Vec::new(),
            rows: Default::default(),
            W: OnceLock::new(),
        }
    }
}

impl<Q, A: Clone, B: Clone, K: Clone> CompositeParts<Q, A, B, K> {
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
    (
        <A as MechanicalSystem>::Configuration,
        <B as MechanicalSystem>::Configuration,
    ),
    <A as MechanicalSystem>::Contact,
    <B as MechanicalSystem>::Contact,
    <K as Coupling<
        <A as MechanicalSystem>::Configuration,
        <B as MechanicalSystem>::Configuration,
    >>::Contact,
>;

/// Two systems and their coupling.
pub struct Composite<'a, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A::Configuration, B::Configuration>,
{
    /// The first.
    pub first: A,
    /// The second.
    pub second: B,
    /// The coupling.
    pub coupling: &'a K,
    /// Scratch.
    pub parts: &'a mut PartsOf<A, B, K>,
}

/// The configurations at which a composite was placed.
fn placed<Q>(q: Option<&Q>) -> &Q {
    q.unwrap_or_else(|| panic!("invariant: a step places its systems before it finds contacts"))
}

fn keep<Q: Clone>(place: &mut Option<Q>, q: &Q) {
    match place {
        Some(own) => own.clone_from(q),
        None => *place = Some(q.clone()),
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<A, B, K> Composite<'_, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A::Configuration, B::Configuration>,
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

    /// Rows of Hᵀ or Zᵀ of the contacts between.
    fn rows<'m>(&self, matrix: &'m [f64]) -> impl Iterator<Item = &'m [f64]> + use<'m, A, B, K> {
        matrix.chunks_exact(self.nv().max(1))
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
            let n = a + b + self.parts.Z.len() / self.nv().max(1);
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
fn harder(a: SolveReport, b: SolveReport) -> SolveReport {
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
        ..worst
    }
}

impl<A, B, K> MechanicalSystem for Composite<'_, A, B, K>
where
    A: MechanicalSystem,
    B: MechanicalSystem,
    K: Coupling<A::Configuration, B::Configuration>,
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
        keep(&mut self.parts.middle, q);
    }

    fn place_end(&mut self, q: &Self::Configuration) {
        self.first.place_end(&q.0);
        self.second.place_end(&q.1);
        keep(&mut self.parts.end, q);
    }

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<Self::Contact>) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        let parts = &mut *self.parts;
        self.first.detect(v_a, activation, &mut parts.first);
        self.second.detect(v_b, activation, &mut parts.second);
        parts.between.clear();
        let (q_a, q_b) = placed(parts.middle.as_ref());
        self.coupling
            .detect((q_a, q_b), (v_a, v_b), activation, &mut parts.between);
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
        let (q_a, q_b) = placed(parts.end.as_ref());
        for contact in &mut parts.between {
            self.coupling.relocate((q_a, q_b), contact);
        }
        for (place, contact) in contacts.iter_mut().zip(parts.listed()) {
            *place = contact;
        }
    }

    fn friction_coefficient(&self, options: &StepOptions, contact: &Self::Contact) -> f64 {
        match contact {
            Of::First(contact) => self.first.friction_coefficient(options, contact),
            Of::Second(contact) => self.second.friction_coefficient(options, contact),
            Of::Between(contact) => self.coupling.friction_coefficient(options, contact),
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
            momentum: a.momentum + b.momentum,
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
        let (n_a, n_b) = (self.first.nv(), self.second.nv());
        let (v_a, v_b) = v.split_at(n_a);
        let [a, b] = self.counts();
        let (u_a, rest) = u.split_at_mut(a);
        let (u_b, between) = rest.split_at_mut(b);
        let parts = &mut *self.parts;
        self.first.assemble(&parts.first, v_a, u_a);
        self.second.assemble(&parts.second, v_b, u_b);
        parts.W.take();
        parts.H.clear();
        parts.H.resize(between.len() * (n_a + n_b), 0.0);
        let [rows_a, rows_b] = &mut parts.rows;
        let (q_a, q_b) = placed(parts.end.as_ref());
        let places = parts.H.chunks_exact_mut(Self::D * (n_a + n_b));
        for (contact, place) in parts.between.iter().zip(places) {
            rows_a.clear();
            rows_a.resize(Self::D * n_a, 0.0);
            rows_b.clear();
            rows_b.resize(Self::D * n_b, 0.0);
            self.coupling.rows((q_a, q_b), contact, (rows_a, rows_b));
            let rows = rows_a.chunks_exact(n_a).zip(rows_b.chunks_exact(n_b));
            for (place, (row_a, row_b)) in place.chunks_exact_mut(n_a + n_b).zip(rows) {
                place[..n_a].copy_from_slice(row_a);
                place[n_a..].copy_from_slice(row_b);
            }
        }
        parts.Z.clone_from(&parts.H);
        for row in parts.Z.chunks_exact_mut(n_a + n_b) {
            let (row_a, row_b) = row.split_at_mut(n_a);
            self.first.half_solve(row_a);
            self.second.half_solve(row_b);
        }
        for (u, row) in between.iter_mut().zip(parts.H.chunks_exact(n_a + n_b)) {
            *u = dot(row, v);
        }
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let (y_a, y_b) = y.split_at(self.first.nv());
        let [out_a, out_b, between] = self.split_mut(out);
        self.first.local(y_a, out_a);
        self.second.local(y_b, out_b);
        for (out, row) in between.iter_mut().zip(self.rows(&self.parts.Z)) {
            *out = dot(row, y);
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[Self::Contact], v: &[f64], out: &mut [f64]) {
        let (v_a, v_b) = v.split_at(self.first.nv());
        let [out_a, out_b, between] = self.split_mut(out);
        let (first, second) = (&self.parts.first, &self.parts.second);
        self.first.add_local_of_velocity(first, v_a, out_a);
        self.second.add_local_of_velocity(second, v_b, out_b);
        for (out, row) in between.iter_mut().zip(self.rows(&self.parts.H)) {
            *out += dot(row, v);
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let [p_a, p_b, between] = self.split(p);
        let (y_a, y_b) = y.split_at_mut(self.first.nv());
        self.first.add_impulses(p_a, y_a);
        self.second.add_impulses(p_b, y_b);
        add_rows(between, self.rows(&self.parts.Z), y);
    }

    fn generalized_impulse(&self, _contacts: &[Self::Contact], p: &[f64], out: &mut [f64]) {
        let [p_a, p_b, between] = self.split(p);
        let (out_a, out_b) = out.split_at_mut(self.first.nv());
        let (first, second) = (&self.parts.first, &self.parts.second);
        self.first.generalized_impulse(first, p_a, out_a);
        self.second.generalized_impulse(second, p_b, out_b);
        add_rows(between, self.rows(&self.parts.H), out);
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Self::DIMENSION, self.operator(), q, mu)
    }

    fn normal_shift(&self, options: &StepOptions, contact: &Self::Contact, u_N_before: f64) -> f64 {
        match contact {
            Of::First(contact) => self.first.normal_shift(options, contact, u_N_before),
            Of::Second(contact) => self.second.normal_shift(options, contact, u_N_before),
            Of::Between(_) => rebound(options.restitution, u_N_before),
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
        if !self.parts.between.is_empty() {
            return solve(&self.problem(q, mu), options, p, u, workspace);
        }
        let (mu_a, mu_b) = mu.split_at(self.parts.first.len());
        let [q_a, q_b, _] = self.split(q);
        let [p_a, p_b, _] = self.split_mut(p);
        let [u_a, u_b, _] = self.split_mut(u);
        harder(
            self.first.solve(q_a, mu_a, options, p_a, u_a, workspace),
            self.second.solve(q_b, mu_b, options, p_b, u_b, workspace),
        )
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let (y_a, y_b) = y.split_at(self.first.nv());
        (self.first.displacement(y_a)).max(self.second.displacement(y_b))
    }
}

/// `out += Σ row p`.
fn add_rows<'m>(p: &[f64], rows: impl Iterator<Item = &'m [f64]>, out: &mut [f64]) {
    for (p, row) in p.iter().zip(rows) {
        for (out, entry) in out.iter_mut().zip(row) {
            *out += entry * p;
        }
    }
}
