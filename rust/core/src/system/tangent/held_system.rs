//! A held step as systems of the scheme, a direction a lane: its contacts are those of the step,
//! and their problems have its answer.

use super::along;
use super::held_places::HeldPlaces;
use super::held_tree::TangentScene;
use super::varying_sand::VaryingSand;
use crate::contact::{ContactKey, Part, clusters_of};
use crate::integrator::grouped::Grouped;
use crate::integrator::systems::{MemoryOf, Systems};
use crate::integrator::{Dynamics, StepOptions, StepReport};
use crate::law::compliance::{Compliance, Yielding};
use crate::law::newton_impact::rebound;
use crate::multibody::LaneConfiguration;
use crate::scalar::{Dual, Lane, Vec3, inlined};
use crate::solver::batch::problem::Triple;
use crate::system::tree_lanes::TreeLanes;

/// What a pass needs of the machine beside the held step: what varies, and scratch.
pub(super) struct HeldParts<T: Lane> {
    pub tree: TreeLanes<Dual<T>>,
    pub places: HeldPlaces<T>,
    /// Wheels of the machine in sand; none before the first step on soft ground.
    pub sand: Option<VaryingSand<T>>,
    pub d_mu: T,
    pub d_stiffness: T,
    pub d_damping: T,
    /// Whether the pass has met what the step did not do.
    pub is_other: bool,
    /// Rows of Hᵀ, each with its velocity, and where those of each contact begin.
    pub rows: Vec<(usize, Triple<Dual<T>>)>,
    pub starts: Vec<usize>,
    /// Velocity before the step (nv), and local velocities there.
    v: Vec<Dual<T>>,
    u_before: Vec<Triple<Dual<T>>>,
    /// What contacts yield under an impulse of 1 N s, m/s; empty where all are rigid.
    softness: Vec<Triple<Dual<T>>>,
}

impl<T: Lane> HeldParts<T> {
    /// Room for a machine.
    pub fn new(tree: TreeLanes<Dual<T>>) -> Self {
        let (token, nv) = (tree.token, tree.nv());
        let zero = T::splat(token, 0.0);
        Self {
            tree,
            places: HeldPlaces::new(token),
            sand: None,
            d_mu: zero,
            d_stiffness: zero,
            d_damping: zero,
            is_other: false,
            rows: Vec::new(),
            starts: Vec::new(),
            v: vec![Dual::constant(zero); nv],
            u_before: Vec::new(),
            softness: Vec::new(),
        }
    }
}

/// A held step in a pass.
pub(super) struct HeldSystem<'a, T: Lane> {
    pub scene: &'a TangentScene<'a>,
    pub own: &'a mut HeldParts<T>,
}

/// Answers with their derivatives, by contact.
#[derive(Clone, Debug)]
pub(super) struct HeldAnswer<T> {
    p: Vec<Triple<Dual<T>>>,
    u: Vec<Triple<Dual<T>>>,
}

impl<T> HeldAnswer<T> {
    /// The answer of no contact.
    pub const NONE: Self = Self {
        p: Vec::new(),
        u: Vec::new(),
    };
}

impl<T: Lane> HeldSystem<'_, T> {
    #[inline(always)]
    pub(super) fn number(&self, x: f64) -> Dual<T> {
        Dual::splat(self.own.tree.token, x)
    }

    #[inline(always)]
    fn n(&self) -> usize {
        self.scene.held.step.contacts.len()
    }

    /// Impulses of the law of a step or of its projection, without derivatives.
    #[inline(always)]
    fn constant(&self, p: &[f64]) -> Vec<Triple<Dual<T>>> {
        let mut all = vec![[self.number(0.0); 3]; self.n()];
        for (own, p) in all.as_flattened_mut().iter_mut().zip(p) {
            *own = self.number(*p);
        }
        all
    }

    /// What impulses change: `F⁻ᵀ H p`, in factor coordinates.
    #[inline(always)]
    fn pushed(&self, p: &[Triple<Dual<T>>]) -> Vec<Dual<T>> {
        let mut y = vec![self.number(0.0); self.own.v.len()];
        for (i, p) in p.iter().enumerate() {
            self.push(i, p, &mut y);
        }
        self.halve(y)
    }

    /// An impulse (nv) in factor coordinates, restricted by the loops.
    #[inline(always)]
    fn halve(&self, mut y: Vec<Dual<T>>) -> Vec<Dual<T>> {
        self.own.tree.half_solve(&mut y);
        if let Some(loops) = &self.own.tree.loops {
            loops.restrict(&mut y);
        }
        y
    }

    /// Local velocities of a change in factor coordinates, with what the contacts yield under
    /// impulses.
    #[inline(always)]
    fn moved(&self, y: &[Dual<T>], p: &[Triple<Dual<T>>]) -> Vec<Triple<Dual<T>>> {
        let mut x = y.to_vec();
        self.own.tree.half_solve_back(&mut x);
        let mut all = self.all_along(&x);
        for (u, (softness, p)) in all.iter_mut().zip(self.own.softness.iter().zip(p)) {
            for k in 0..3 {
                u[k] += softness[k] * p[k];
            }
        }
        all
    }

    /// `Hᵀ x` of all contacts, x (nv).
    #[inline(always)]
    fn all_along(&self, x: &[Dual<T>]) -> Vec<Triple<Dual<T>>> {
        let mut all = vec![[self.number(0.0); 3]; self.n()];
        for (i, own) in all.iter_mut().enumerate() {
            *own = self.along(i, x);
        }
        all
    }

    /// Derivatives of the impulses, from those of the velocities at held impulses.
    #[inline(always)]
    fn answered<'r>(
        &self,
        rows: impl Iterator<Item = (&'r [f64], f64)>,
        u: &[Triple<Dual<T>>],
    ) -> Vec<T> {
        let d_mu = self.own.d_mu;
        let mut du = vec![d_mu; 3 * u.len()];
        for (own, u) in du.iter_mut().zip(u.as_flattened()) {
            *own = u.slope;
        }
        let mut dp = vec![d_mu; du.len()];
        for (own, (row, of_mu)) in dp.iter_mut().zip(rows) {
            *own = along(row, &du, d_mu * d_mu.like(of_mu));
        }
        dp
    }

    /// The answer for free velocities, and the free change of the velocity in factor coordinates.
    #[inline(always)]
    fn answer(&mut self, q: &[Triple<Dual<T>>], free: &[Dual<T>]) -> HeldAnswer<T> {
        let step = &self.scene.held.step;
        let p = self.constant(&step.law.p);
        // With held impulses.
        let pushed = self.pushed(&p);
        let mut u = self.moved(&pushed, &p);
        for (u, q) in u.iter_mut().zip(q) {
            for k in 0..3 {
                u[k] += q[k];
            }
        }
        let mut dp = self.answered(step.answer.rows(), &u);
        if self.own.sand.is_some() && self.scene.held.sand.is_some() {
            let mut change = pushed;
            for (change, free) in change.iter_mut().zip(free) {
                *change += *free;
            }
            self.own.tree.half_solve_back(&mut change);
            let mut dv = vec![self.own.d_mu; change.len()];
            for (own, (v, change)) in dv.iter_mut().zip(self.own.v.iter().zip(&change)) {
                *own = v.slope + change.slope;
            }
            add_response(&step.response, &dp, &mut dv);
            if let Some(more) = self.yield_sand(&dv) {
                for (i, u) in u.iter_mut().enumerate() {
                    let moved = self.along(i, &more);
                    for k in 0..3 {
                        u[k].slope += moved[k].slope;
                    }
                }
                dp = self.answered(step.answer.rows(), &u);
            }
        }
        let size = dp.len();
        for (u, row) in (u.as_flattened_mut().iter_mut()).zip(step.W.chunks_exact(size.max(1))) {
            u.slope = along(row, &dp, u.slope);
        }
        HeldAnswer {
            p: with_slopes(p, &dp),
            u,
        }
    }
}

/// Impulses with their derivatives.
#[inline(always)]
fn with_slopes<T: Lane>(mut p: Vec<Triple<Dual<T>>>, dp: &[T]) -> Vec<Triple<Dual<T>>> {
    for (p, dp) in p.as_flattened_mut().iter_mut().zip(dp) {
        p.slope = *dp;
    }
    p
}

impl<T: Lane> Systems for HeldSystem<'_, T> {
    type T = Dual<T>;
    type Configuration = LaneConfiguration<Dual<T>>;
    type Machine = TreeLanes<Dual<T>>;
    type Local = Triple<Dual<T>>;
    type Key = ContactKey;
    type Contacts = HeldPlaces<T>;
    type Problems = HeldAnswer<T>;

    #[inline(always)]
    fn run<R>(token: T::Token, f: impl FnOnce() -> R) -> R {
        T::vectorize(token, f)
    }

    #[inline(always)]
    fn machine(&self) -> &TreeLanes<Dual<T>> {
        &self.own.tree
    }

    #[inline(always)]
    fn machine_mut(&mut self) -> &mut TreeLanes<Dual<T>> {
        &mut self.own.tree
    }

    #[inline(always)]
    fn gravity(&self) -> Vec3<Dual<T>> {
        self.own.tree.gravity
    }

    #[inline(always)]
    fn contacts(&self) -> &HeldPlaces<T> {
        &self.own.places
    }

    #[inline(always)]
    fn n_places(&self) -> usize {
        self.n()
    }

    fn detect(
        &mut self,
        _: &StepOptions,
        (_, end): (&Self::Configuration, &Self::Configuration),
        _: &[Dual<T>],
        _: T::Mask,
    ) -> T::Mask {
        let token = self.own.tree.token;
        inlined!(T::vectorize, token, {
            self.place_contacts(end);
            self.press_sand();
        });
        T::mask(token, 0)
    }

    /// A held step has no memory.
    fn recall(
        &mut self,
        _: usize,
        _: &MemoryOf<Self>,
        _: &mut HeldAnswer<T>,
        is_same: &mut [T::Mask],
    ) {
        is_same.fill(T::mask(self.own.tree.token, 0));
    }

    #[inline(always)]
    fn read_start(&self, _: &HeldAnswer<T>, p: &mut [Self::Local]) {
        p.fill([self.number(0.0); 3]);
    }

    fn assemble(&mut self, v: &[Dual<T>]) {
        self.own.v.copy_from_slice(v);
        self.own.softness.clear();
        self.own.u_before = inlined!(T::vectorize, self.own.tree.token, {
            self.write_rows();
            self.all_along(v)
        });
    }

    #[inline(always)]
    fn u_before(&self) -> &[Self::Local] {
        &self.own.u_before
    }

    #[inline(always)]
    fn lever(&self, i: usize) -> Option<Dual<T>> {
        match self.scene.held.step.contacts[i].part {
            Part::Limit(joint, _) => {
                let arm = self.scene.model.mechanism().joints[joint].arm;
                Some(self.number(arm))
            }
            _ => None,
        }
    }

    #[inline(always)]
    fn yields(&self) -> bool {
        self.scene.model.has_compliance()
    }

    #[inline(always)]
    fn compliance(&self, i: usize, v: &[Dual<T>]) -> (Option<Compliance<Dual<T>>>, T::Mask) {
        (self.spring(i, v), self.own.places.active(i))
    }

    fn remembers(&self, _: usize, _: &MemoryOf<Self>, _: usize) -> bool {
        false
    }

    fn own_cluster(&self, i: usize, _: usize) -> usize {
        clusters_of(self.scene.model, &self.scene.held.step.contacts[i].key)[0]
    }

    /// Contacts that bounce although they yield are rigid in the held step.
    #[inline(always)]
    fn restitution(&self, _: &StepOptions, _: usize) -> Dual<T> {
        self.number(0.0)
    }

    fn soften(&mut self, laws: &[Yielding<Dual<T>>]) {
        let softness = laws.iter().map(|law| law.diagonal);
        self.own.softness = softness.collect();
    }

    #[inline(always)]
    fn immovable(&self, i: usize) -> T::Mask {
        let is_immovable = self.scene.held.step.immovable[i];
        let lanes = if is_immovable {
            u32::MAX >> (32 - T::LANES)
        } else {
            0
        };
        T::mask(self.own.tree.token, lanes)
    }

    #[inline(always)]
    fn local(&self, y: &[Dual<T>], u: &mut [Self::Local]) {
        let mut x = y.to_vec();
        self.own.tree.half_solve_back(&mut x);
        for (i, (u, before)) in u.iter_mut().zip(&self.own.u_before).enumerate() {
            *u = self.along(i, &x);
            for k in 0..3 {
                u[k] += before[k];
            }
        }
    }

    #[inline(always)]
    fn add_impulses(&self, _: T::Mask, p: &[Self::Local], y: &mut [Dual<T>]) {
        for (y, change) in y.iter_mut().zip(self.pushed(p)) {
            *y += change;
        }
    }

    #[inline(always)]
    fn add_moments(&self, y: &mut [Dual<T>]) {
        if self.own.sand.is_some() {
            let mut impulse = vec![self.number(0.0); y.len()];
            self.add_changes_of_sand(&mut impulse);
            for (y, change) in y.iter_mut().zip(self.halve(impulse)) {
                *y += change;
            }
        }
    }

    /// Nothing: the next step of a pass has no memory of this one.
    #[inline(always)]
    fn generalized_impulse(&self, _: T::Mask, _: &[Self::Local], out: &mut [Dual<T>]) {
        out.fill(self.number(0.0));
    }

    #[inline(always)]
    fn add_shifts(
        &self,
        _: &StepOptions,
        sign: f64,
        laws: &[Yielding<Dual<T>>],
        u: &mut [Self::Local],
    ) {
        for (i, u) in u.iter_mut().enumerate() {
            let is_soft = !laws.is_empty() && self.scene.held.contacts[i].is_soft;
            let restitution = self.scene.held.contacts[i].restitution;
            if restitution > 0.0 && !is_soft {
                let before = self.own.u_before[i][0];
                u[0] += self.number(sign) * rebound(self.number(restitution), before);
            }
        }
    }

    fn pose(
        &mut self,
        _: &StepOptions,
        (q, change): (&[Self::Local], &[Dual<T>]),
        _: &[Self::Local],
        _: &[T::Mask],
        _: T::Mask,
        problems: &mut HeldAnswer<T>,
    ) {
        *problems = inlined!(T::vectorize, self.own.tree.token, self.answer(q, change));
    }

    fn take_answers(
        &mut self,
        _: &StepOptions,
        _: T::Mask,
        _: &mut HeldAnswer<T>,
        _: &mut [StepReport],
        _: &mut [MemoryOf<Self>],
    ) -> T::Mask {
        T::mask(self.own.tree.token, u32::MAX >> (32 - T::LANES))
    }

    #[inline(always)]
    fn read(&self, problems: &HeldAnswer<T>, p: &mut [Self::Local], u: &mut [Self::Local]) {
        p.copy_from_slice(&problems.p);
        u.copy_from_slice(&problems.u);
    }

    fn place_in_memory(&self, i: usize, _: usize) -> usize {
        i
    }

    fn norms(&self, _: &HeldAnswer<T>, _: (usize, usize), _: &[Self::Local]) -> Option<[f64; 2]> {
        None
    }

    #[inline(always)]
    fn pose_gaps(
        &mut self,
        gaps: &[Self::Local],
        is_deep: &[T::Mask],
        pushes: &mut [Self::Local],
        problems: &mut HeldAnswer<T>,
    ) {
        let Some(projection) = &self.scene.held.step.projection else {
            self.own.is_other = true;
            problems.p = pushes.to_vec();
            return;
        };
        let p = self.constant(&projection.law.p);
        let mut u = self.moved(&self.pushed(&p), &p);
        for (i, (u, gap)) in u.iter_mut().zip(gaps).enumerate() {
            u[0] += Dual::select(
                self.own.places.mask_of(i, is_deep),
                gap[0],
                gap[0].like(0.0),
            );
        }
        let dp = self.answered(projection.answer.rows(), &u);
        problems.p = with_slopes(p, &dp);
    }

    fn take_displacements(
        &mut self,
        _: &StepOptions,
        _: T::Mask,
        _: &mut HeldAnswer<T>,
        _: &[T::Mask],
        _: &mut [StepReport],
        _: &mut [Dual<T>],
    ) -> T::Mask {
        T::mask(self.own.tree.token, 0)
    }

    #[inline(always)]
    fn read_pushes(&self, problems: &HeldAnswer<T>, pushes: &mut [Self::Local]) {
        pushes.copy_from_slice(&problems.p);
    }
}

/// `dv += (M̂⁻¹ H) dp`.
#[inline(always)]
fn add_response<T: Lane>(response: &[f64], dp: &[T], dv: &mut [T]) {
    if !dp.is_empty() {
        for (own, row) in dv.iter_mut().zip(response.chunks_exact(dp.len())) {
            *own = along(row, dp, *own);
        }
    }
}
