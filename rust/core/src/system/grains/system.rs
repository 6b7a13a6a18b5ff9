//! Grains as a [`crate::integrator::MechanicalSystem`]: a diagonal mass matrix, contacts
//! between pairs of bodies, and a machine with a dense one.

use std::sync::OnceLock;

use nalgebra::SVector;

use super::bodies::COORDINATES;
use super::contact::{GrainContact, GrainKey, WALL};
use super::grid::Grid;
use super::rolling::{Moments, RollingParts};
use super::scene::{GrainScene, flat};
use super::search::{Neighbour, Search};
use super::slabs::Slabs;
use super::struck_pairs::{MOST_REPETITIONS, Struck};
use crate::contact::Activation;
use crate::geometry::Facing;
use crate::integrator::{
    Dynamics, Forces, MechanicalSystem, Stabilisation, StepOptions, StepStart,
};
use crate::law::newton_impact::{rebound_at_gap, slow_approach};
use crate::planar::{PlanarPoses, PlanarTree};
use crate::problem::{
    BlockSparseDelassus, BodyPairs, Dimension, FrictionContactProblem, RoundPair,
};
use crate::solver::{
    ContactSolution, ManyBodies, SolveReport, SolverOptions, SolverWorkspace, Swept,
    solve_many_bodies,
};
use crate::spatial::space::body_velocities;
use crate::system::planar_matrices::PlanarMatrices;

/// The place of fixed bodies, with c = s = 0.
const NOWHERE: u32 = 0;

/// How much the square of a unit tangent may differ from 1.
const TURNED: f64 = 1e-9;

/// The motion of a surface at a contact with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driven<const D: usize> {
    pub key: GrainKey,
    /// m/s.
    pub velocity: SVector<f64, D>,
    /// Angular velocity, rad/s.
    pub spin: [f64; 3],
}

/// Matrices of a step: scratch.
#[derive(Debug, Default)]
pub struct GrainParts<const D: usize> {
    pub(in crate::system) middle: Vec<f64>,
    pub(in crate::system) end: Vec<f64>,
    pub(in crate::system) grid: Grid<D>,
    /// How far detection looked in the last step.
    pub(in crate::system) search: Search,
    /// Pairs that only an impact of this step brings together.
    pub(super) struck: Struck,
    pub(super) found: Vec<Neighbour<D>>,
    pub(super) facing: Vec<Facing<D>>,
    /// Contacts with surfaces that move, in the order of the keys.
    pub(super) driven: Vec<Driven<D>>,
    /// How long walls have been moving, s.
    pub(crate) wall_time: f64,
    /// Force of the cohesion on every grain's coordinates, N and N m.
    attraction: Vec<f64>,
    pub(in crate::system) pairs: BodyPairs<D>,
    pub(crate) rolling: RollingParts,
    /// The machine at the middle and at the end of the step.
    pub(super) machine_poses: [PlanarPoses; 2],
    machine: PlanarMatrices,
    slabs: Slabs,
    /// W, assembled on request.
    operator: OnceLock<BlockSparseDelassus>,
}

impl<const D: usize> Clone for GrainParts<D> {
    /// Scratch is not copied.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<const D: usize> GrainParts<D> {
    /// The last step's contacts as pairs of bodies.
    #[must_use]
    pub fn pairs(&self) -> &BodyPairs<D> {
        &self.pairs
    }

    /// Motion of the surface at a contact, if it moves.
    #[inline]
    pub(super) fn surface(&self, key: GrainKey) -> Option<&Driven<D>> {
        if self.driven.is_empty() {
            return None;
        }
        let place = (self.driven).binary_search_by_key(&key, |driven| driven.key);
        place.ok().map(|k| &self.driven[k])
    }

    /// The operator W of the last step's contacts, block by block, 1/kg.
    pub fn operator(&self) -> &BlockSparseDelassus {
        self.operator.get_or_init(|| self.pairs.operator())
    }
}

/// Grains and the loads on them in a step.
#[derive(Debug)]
pub struct GrainSystem<'a, const D: usize> {
    /// The description.
    pub scene: &'a GrainScene<D>,
    /// Which grains sleep (n): they have no velocity and stay in place, whatever touches them.
    pub asleep: &'a [bool],
    /// Moments of rolling friction in the last step.
    pub moments: &'a Moments,
    /// Torques of the machine, N m.
    pub inputs: &'a [f64],
    /// A force at the machine's origin, N.
    pub pull: SVector<f64, D>,
    /// Scratch of the system.
    pub parts: &'a mut GrainParts<D>,
}

/// Velocity of the rim of a grain that faces along ∓n, in the contact's
/// frame: `r` is negative where n points away from it.
///
/// In the plane `v + ω r t`; in space `v − r ω × n`.
#[inline]
fn add_rim_velocity<const D: usize>(
    v: &[f64],
    r: f64,
    n: &SVector<f64, D>,
    sign: f64,
    sum: &mut SVector<f64, D>,
) {
    let mut rim = *n;
    if D == 2 {
        rim[0] = v[0] + v[2] * r * n[1];
        rim[1] = v[1] - v[2] * r * n[0];
    } else {
        let spin = &v[D..];
        for k in 0..D {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            rim[k] = v[k] - r * (spin[i] * n[j] - spin[j] * n[i]);
        }
    }
    *sum += rim * sign;
}

impl<const D: usize> GrainSystem<'_, D> {
    /// The machine's poses at a configuration of the step.
    fn place_machine(&mut self, q: &[f64], which: usize) {
        if let Some(machine) = &self.scene.machine {
            let own = self.scene.machine_coordinates(q);
            machine.place(own, &mut self.parts.machine_poses[which]);
        }
    }

    /// How many grains.
    pub(super) fn n(&self) -> usize {
        self.scene.grains.len()
    }

    /// A pair of nothing that moves, as the machine's side, with a grain that is pushed at a point
    /// `gap` (m) above its surface, or with none.
    pub(in crate::system) fn pair_with(
        &self,
        pushed: Option<(u32, f64)>,
        frame: &[SVector<f64, D>; D],
    ) -> RoundPair<D> {
        let nothing = (NOWHERE, 0.0, 0.0);
        let (at, c, s) = pushed.map_or(nothing, |(grain, gap)| {
            let (at, c, s) = side(self.scene, self.asleep, grain);
            let radius = self.scene.grains.radius()[grain as usize];
            (at, c, s * ((radius + gap) / radius))
        });
        RoundPair {
            bodies: [NOWHERE, at],
            frame: frame.map(Into::into),
            linear: [0.0, c],
            angular: [0.0, s],
            is_turned: D == 3 && (frame[2].norm_squared() - 1.0).abs() > TURNED,
        }
    }

    /// Subtracts the velocity of a grain's point that is `gap` (m) above its surface along n, in a
    /// contact's frame.
    pub(in crate::system) fn subtract_point(
        &self,
        (grain, gap): (u32, f64),
        v: &[f64],
        frame: &[SVector<f64, D>; D],
        u: &mut [f64],
    ) {
        let (i, V) = (grain as usize, body_velocities(D));
        let arm = self.scene.grains.radius()[i] + gap;
        let mut rim = SVector::zeros();
        add_rim_velocity(&v[V * i..V * (i + 1)], -arm, &frame[0], -1.0, &mut rim);
        for (u, direction) in u.iter_mut().zip(frame) {
            *u += direction.dot(&rim);
        }
    }

    /// `out += H p` of one impulse that pushes a grain at a point `gap` (m) above its surface along
    /// n.
    pub(in crate::system) fn push_grain(
        &self,
        (grain, gap): (u32, f64),
        frame: &[SVector<f64, D>; D],
        p: &[f64; D],
        out: &mut [f64],
    ) {
        let (i, V) = (grain as usize, body_velocities(D));
        let out = &mut out[V * i..V * (i + 1)];
        let arm = self.scene.grains.radius()[i] + gap;
        let turn = moment(frame, p);
        for k in 0..D {
            out[k] -= (0..D).map(|r| frame[r][k] * p[r]).sum::<f64>();
        }
        for k in D..V {
            out[k] += arm * turn[k - D];
        }
    }

    /// μ of a contact.
    fn friction_of(&self, key: GrainKey) -> f64 {
        let friction = &self.scene.friction;
        if key.a as usize >= self.n() {
            friction.wheels
        } else if key.b >= WALL {
            friction.walls
        } else {
            friction.grains
        }
    }

    /// Sums the attraction of the contacts over the grains that are awake.
    fn attract(&mut self, contacts: &[GrainContact<D>]) {
        let Some(cohesion) = self.scene.grains.cohesion() else {
            return;
        };
        let (n, V) = (self.n(), body_velocities(D));
        let sum = &mut self.parts.attraction;
        sum.clear();
        sum.resize(V * n, 0.0);
        for contact in contacts {
            let force = contact.n * cohesion.at(contact.gap_start);
            for (body, sign) in [(contact.key.a, -1.0), (contact.key.b, 1.0)] {
                let i = body as usize;
                if i < n && !self.asleep[i] {
                    for k in 0..D {
                        sum[V * i + k] += sign * force[k];
                    }
                }
            }
        }
    }

    /// Divides an impulse by the roots of the diagonal.
    fn divide_by_roots(&self, y: &mut [f64]) {
        let rows = y.chunks_exact_mut(body_velocities(D));
        for (y, [m, J]) in rows.zip(&self.scene.grains.roots) {
            for y in &mut y[..D] {
                *y /= m;
            }
            for y in &mut y[D..] {
                *y /= J;
            }
        }
    }
}

impl<const D: usize> GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    /// Solves the contacts of the pairs of bodies.
    pub(in crate::system) fn solve_rolling(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        answer: ContactSolution<'_>,
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let bodies = ManyBodies {
            pairs: &self.parts.pairs,
            q,
            mu,
            operator: &|| self.parts.operator(),
        };
        solve_many_bodies(&bodies, options, answer, workspace)
    }
}

/// Place of a body's factor coordinates, and their c and s: nowhere and 0 for what does not move.
fn side<const D: usize>(scene: &GrainScene<D>, asleep: &[bool], body: u32) -> (u32, f64, f64) {
    let i = body as usize;
    if i < scene.grains.len() && !asleep[i] {
        let (c, s) = (scene.grains.linear[i], scene.grains.angular[i]);
        #[allow(clippy::cast_possible_truncation)] // 3 or 6
        let width = body_velocities(D) as u32;
        (width * body, c, s)
    } else {
        (NOWHERE, 0.0, 0.0)
    }
}

/// Two or three components.
const fn dimension(dimensions: usize) -> Dimension {
    if dimensions == 2 {
        Dimension::Two
    } else {
        Dimension::Three
    }
}

/// Dynamics without an energy audit: frames are those of the start of the step and grains have no
/// gyroscopic terms, so a step with θ ≥ ½ is passive by construction.
impl<const D: usize> Dynamics for GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    type T = f64;

    /// [`COORDINATES`] of each grain, then the machine's, m and rad.
    type Configuration = Vec<f64>;

    fn nv(&self) -> usize {
        self.scene.nv()
    }

    fn advance(&self, q: &mut Vec<f64>, v: &[f64], h: f64) {
        let (n, V) = (self.n(), body_velocities(D));
        let (grains, machine) = q.split_at_mut(COORDINATES * n);
        let (of_grains, of_machine) = v.split_at(V * n);
        let rows = grains.chunks_exact_mut(COORDINATES);
        for (q, v) in rows.zip(of_grains.chunks_exact(V)) {
            for (q, v) in q.iter_mut().zip(v) {
                *q += h * v;
            }
        }
        for (q, v) in machine.iter_mut().zip(of_machine) {
            *q += h * v;
        }
    }

    fn is_finite(&self, q: &Vec<f64>) -> bool {
        q.iter().all(|x| x.is_finite())
    }

    fn place_middle(&mut self, q: &Vec<f64>) {
        self.parts.middle.clone_from(q);
        self.place_machine(q, 0);
    }

    fn place_end(&mut self, q: &Vec<f64>) {
        self.parts.end.clone_from(q);
        self.place_machine(q, 1);
    }

    fn update_mass_matrix(&mut self, _options: &StepOptions, _: bool, _: bool) {
        if let Some(machine) = self.scene.machine.as_deref() {
            let GrainParts {
                machine_poses: [middle, _],
                machine: own,
                ..
            } = &mut *self.parts;
            own.set_mass(machine, middle);
        }
    }

    fn factorise(&mut self, _options: &StepOptions) -> bool {
        self.scene.machine.is_none() || self.parts.machine.factorise()
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let V = body_velocities(D);
        let rows = v.chunks_exact(V).zip(out.chunks_exact_mut(V));
        for ((v, out), [m, J]) in rows.zip(&self.scene.grains.roots) {
            for k in 0..V {
                let root = if k < D { m } else { J };
                out[k] = root * root * v[k];
            }
        }
        if self.scene.machine.is_some() {
            let rate = self.scene.machine_velocities(v);
            self.parts
                .machine
                .multiply_mass(rate, &mut out[V * self.n()..]);
        }
    }

    fn half_solve(&self, y: &mut [f64]) {
        self.divide_by_roots(y);
        if self.scene.machine.is_some() {
            let at = body_velocities(D) * self.n();
            self.parts.machine.forward(&mut y[at..]);
        }
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        self.divide_by_roots(y);
        if self.scene.machine.is_some() {
            let at = body_velocities(D) * self.n();
            self.parts.machine.backward(&mut y[at..]);
        }
    }

    fn displacement(&self, y: &[f64], _cluster: usize) -> f64 {
        match &self.scene.machine {
            Some(machine) => machine.displacement(self.scene.machine_velocities(y)),
            None => 0.0,
        }
    }
}

impl<const D: usize> Forces for GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    fn choose_branches(&mut self, _v: &[f64]) {
        self.parts.struck.clear();
    }

    fn most_revisions(&self, _: usize) -> usize {
        MOST_REPETITIONS
    }

    fn revise(&mut self, _: bool, v: &[f64], v_end: &[f64]) -> bool {
        self.find_struck(v, v_end)
    }

    fn load(
        &mut self,
        options: &StepOptions,
        _start: StepStart<'_, Vec<f64>>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let (h, V) = (options.time_step, body_velocities(D));
        let gravity = &options.gravity;
        let masses = self.scene.grains.mass().iter().zip(self.asleep);
        for (y, (m, sleeps)) in y.chunks_exact_mut(V).zip(masses) {
            let m = if *sleeps { 0.0 } else { *m };
            for k in 0..D {
                y[k] = h * m * gravity[k];
            }
            y[D..].fill(0.0);
        }
        for (y, force) in y.iter_mut().zip(&self.parts.attraction) {
            *y += h * force;
        }
        if let Some(machine) = &self.scene.machine {
            let rate = self.scene.machine_velocities(v_mean);
            let force = &mut y[V * self.n()..];
            let middle = &mut self.parts.machine_poses[0];
            machine.force(middle, rate, &gravity.xy(), self.inputs, force);
            for (force, pull) in force.iter_mut().zip(&flat(&self.pull)) {
                *force += pull;
            }
            for force in force {
                *force *= h;
            }
        }
    }
}

impl<const D: usize> MechanicalSystem for GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    type Machine = Self;

    fn machine(&self) -> &Self {
        self
    }

    fn machine_mut(&mut self) -> &mut Self {
        self
    }

    type Contact = GrainContact<D>;

    const DIMENSION: Dimension = dimension(D);

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<GrainContact<D>>) {
        self.find_contacts(v, activation, out);
    }

    fn relocate(&mut self, contacts: &mut [GrainContact<D>]) {
        self.forecast_gaps(contacts);
    }

    fn friction_coefficient(&self, _options: &StepOptions, contact: &GrainContact<D>) -> f64 {
        self.friction_of(contact.key)
    }

    fn assemble(&mut self, contacts: &[GrainContact<D>], v: &[f64], u: &mut [f64]) {
        let (n, V) = (self.n(), body_velocities(D));
        let scene = self.scene;
        let machine = scene.machine.as_deref();
        let GrainParts {
            middle,
            pairs,
            machine_poses: [poses, _],
            machine: own,
            operator,
            slabs,
            search,
            ..
        } = &mut *self.parts;
        let width = machine.map_or(0, PlanarTree::nv);
        pairs.clear(width, V * n, scene.nv());
        if D == 3 {
            let width = 2.0 * scene.grains.largest() + search.reach;
            slabs.assign(middle, n, width, &mut pairs.slabs);
        }
        own.clear_rows(width);
        operator.take();
        let asleep = self.asleep;
        let side = |body: u32| side(scene, asleep, body);
        for contact in contacts {
            let GrainKey { a, b } = contact.key;
            // A wheel is not a grain: its side of the pair is empty.
            let (at_a, c_a, s_a) = side(a);
            let (at_b, c_b, s_b) = side(b);
            let frame = contact.frame();
            let pair = RoundPair {
                bodies: [at_a, at_b],
                frame: frame.map(Into::into),
                linear: [c_a, c_b],
                angular: [s_a, s_b],
                is_turned: false,
            };
            if (a as usize) < n {
                pairs.round.push(pair);
            } else if let Some(machine) = machine {
                let (wheel, point) = (a as usize - n, flat(&contact.point));
                let frame = frame.each_ref().map(flat);
                own.push_contact((machine, poses), wheel, &point, &frame, &mut pairs.rows);
                pairs.machine.push(pair);
            }
        }
        self.attract(contacts);
        (self.parts.rolling).assemble(scene, contacts, self.moments);
        u.fill(0.0);
        self.add_local_of_velocity(contacts, v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        self.parts.pairs.local(y, out);
    }

    fn add_local_of_velocity(&self, contacts: &[GrainContact<D>], v: &[f64], out: &mut [f64]) {
        let (n, V) = (self.n(), body_velocities(D));
        let radius = self.scene.grains.radius();
        let own = self.scene.machine_velocities(v);
        let mut of_machine = 0;
        for (contact, out) in contacts.iter().zip(out.chunks_exact_mut(D)) {
            let mut u = SVector::zeros();
            let (a, b) = (contact.key.a as usize, contact.key.b as usize);
            if a < n {
                add_rim_velocity(&v[V * a..V * (a + 1)], radius[a], &contact.n, 1.0, &mut u);
            }
            if contact.is_with_grain() {
                add_rim_velocity(&v[V * b..V * (b + 1)], -radius[b], &contact.n, -1.0, &mut u);
            } else if let Some(surface) = self.parts.surface(contact.key) {
                u -= surface.velocity;
            }
            for (out, direction) in out.iter_mut().zip(contact.frame()) {
                *out += direction.dot(&u);
            }
            if a >= n {
                self.parts.machine.add_local(of_machine, own, out);
                of_machine += 1;
            }
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        self.parts.pairs.add_impulses(p, y);
    }

    fn generalized_impulse(&self, contacts: &[GrainContact<D>], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let (n, V) = (self.n(), body_velocities(D));
        let radius = self.scene.grains.radius();
        let mut of_machine = 0;
        for (contact, p) in contacts.iter().zip(p.as_chunks::<D>().0) {
            let frame = contact.frame();
            let mut force = frame[0] * p[0];
            for k in 1..D {
                force += frame[k] * p[k];
            }
            let turn = moment(&frame, p);
            let (a, b) = (contact.key.a as usize, contact.key.b as usize);
            let mut add = |body: usize, sign: f64| {
                let out = &mut out[V * body..V * (body + 1)];
                for k in 0..D {
                    out[k] += sign * force[k];
                }
                for k in D..V {
                    out[k] += radius[body] * turn[k - D];
                }
            };
            if a < n {
                add(a, 1.0);
            }
            if contact.is_with_grain() {
                add(b, -1.0);
            }
            if a >= n {
                let own = &mut out[V * n..];
                self.parts.machine.add_impulse(of_machine, p, own);
                of_machine += 1;
            }
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(self.parts.operator(), q, mu)
    }

    fn normal_shift(
        &self,
        options: &StepOptions,
        contact: &GrainContact<D>,
        u_N_before: f64,
    ) -> f64 {
        gap_law(options, contact.gap_start, u_N_before)
    }

    /// Always false: sweeps end at a loose tolerance, and a pile that bounces needs many.
    fn solves_to_the_end(&self) -> bool {
        false
    }

    fn solve(
        &mut self,
        free: Option<(&[f64], &[f64])>,
        (q, mu): (&[f64], &[f64]),
        options: &SolverOptions,
        (p, u): (&mut [f64], &mut [f64]),
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let Some(free) = free else {
            let rolling = &mut [];
            let answer = ContactSolution { p, u, rolling };
            return self.solve_rolling(q, mu, options, answer, workspace);
        };
        let mut moments = std::mem::take(&mut self.parts.rolling);
        let surface = |key| self.parts.surface(key).map(|surface| surface.spin);
        moments.set_free(self.scene, free, surface);
        let rolling = &mut moments.contacts;
        let answer = ContactSolution { p, u, rolling };
        let report = self.solve_rolling(q, mu, options, answer, workspace);
        self.parts.rolling = moments;
        report
    }

    fn add_moments(&self, y: &mut [f64]) {
        self.parts.rolling.add(&self.parts.pairs.round, y);
    }
}

/// Share of an excessive overlap by which a pair parts in a step, see [`Stabilisation::PushOut`].
const PUSHED_OUT: f64 = 0.2;

/// Shift of the normal free velocity of a pair with the gap `gap_start`, m, see
/// [`rebound_at_gap`]; an excessive overlap is pushed out.
pub(in crate::system) fn gap_law(options: &StepOptions, gap_start: f64, u_N_before: f64) -> f64 {
    let h = options.time_step;
    let excess = gap_start + options.penetration_tolerance.unwrap_or(0.0);
    if excess < 0.0 && options.stabilisation == Stabilisation::PushOut {
        return PUSHED_OUT * excess / h;
    }
    let slow = slow_approach(options.gravity.norm(), h);
    rebound_at_gap(options.restitution, u_N_before, gap_start, (h, slow))
}

/// Moment of the tangential impulses, divided by r: p_t in the plane, `b p_t − t p_b` in space.
fn moment<const D: usize>(frame: &[SVector<f64, D>; D], p: &[f64; D]) -> SVector<f64, D> {
    if D == 2 {
        return SVector::from_fn(|k, _| if k == 0 { p[1] } else { 0.0 });
    }
    frame[2] * p[1] - frame[1] * p[2]
}
