//! The soil as a [`MechanicalSystem`]: a diagonal mass matrix, contacts between pairs of bodies.

use std::sync::OnceLock;

use nalgebra::{Cholesky, SMatrix, SVector, Vector2};

use super::super::ground::Facing;
use super::contact::{GROUND, SoilContact, SoilKey, WALL};
use super::grid::Grid;
use super::scene::SoilScene;
use crate::contact::Activation;
use crate::integrator::{MechanicalSystem, Start, StepOptions};
use crate::problem::{
    BlockSparseDelassus, BodyPairs, Dimension, DiscPair, FrictionContactProblem, PairContact, WIDE,
    WidePair,
};
use crate::solver::{ManyBodies, SolveReport, SolverOptions, SolverWorkspace, solve_many_bodies};

/// Gap up to which a pair is taken as a contact though it is not forecast to close, as a share of the smallest radius: its neighbours may push it.
const SKIN: f64 = 0.01;

/// Largest such gap, as a share of the smallest radius: a blow that throws farther in one step is a step that is too long.
const FARTHEST_SKIN: f64 = 0.2;

/// A place that holds nothing that moves: c = s = 0 there.
const NOWHERE: u32 = 0;

/// Matrices of a step: scratch.
#[derive(Debug, Default)]
pub struct SoilParts {
    middle: Vec<f64>,
    end: Vec<f64>,
    grid: Grid,
    found: Vec<(u32, [f64; 3])>,
    facing: Vec<Facing>,
    pairs: BodyPairs,
    /// Rows n and t of Hᵀ of the machine's contacts.
    rows: Vec<[SVector<f64, 5>; 2]>,
    mass: SMatrix<f64, 5, 5>,
    /// Lower factor of the machine's mass matrix.
    L: SMatrix<f64, 5, 5>,
    /// W, made where it is asked for.
    operator: OnceLock<BlockSparseDelassus>,
}

impl Clone for SoilParts {
    /// Scratch is not worth copying.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl SoilParts {
    /// The last step's contacts as pairs of bodies.
    #[must_use]
    pub fn pairs(&self) -> &BodyPairs {
        &self.pairs
    }
}

/// A soil, with what acts on it in a step.
#[derive(Debug)]
pub struct SoilSystem<'a> {
    /// The description.
    pub scene: &'a SoilScene,
    /// Which disks sleep (n): they have no velocity and stay where they are, whatever touches them.
    pub asleep: &'a [bool],
    /// Torques of the machine, N m.
    pub inputs: &'a [f64],
    /// A force at the machine's first two coordinates, N.
    pub pull: Vector2<f64>,
    /// Its scratch.
    pub parts: &'a mut SoilParts,
}

/// Velocity of the rim point of a disk that faces along −n: `v + ω r t`.
#[inline]
fn rim_velocity(v: &[f64], r: f64, n: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(v[0] + v[2] * r * n.y, v[1] - v[2] * r * n.x)
}

/// Finds disks near a disc of number above `after`, in the order of their numbers: `(number, [distance, direction from it])`.
#[inline]
fn gather(
    grid: &Grid,
    centre: [f64; 2],
    radius: f64,
    reach: f64,
    largest: f64,
    after: Option<u32>,
    found: &mut Vec<(u32, [f64; 3])>,
) {
    found.clear();
    let [x, y] = centre;
    grid.near(x, y, radius + largest + reach, |item| {
        if after.is_some_and(|i| item.index <= i) {
            return;
        }
        let (dx, dy) = (x - item.x, y - item.y);
        let square = dx * dx + dy * dy;
        let limit = radius + item.radius + reach;
        if square <= limit * limit {
            let distance = square.sqrt();
            found.push((item.index, [distance - radius - item.radius, dx, dy]));
        }
    });
    found.sort_unstable_by_key(|(index, _)| *index);
}

/// Unit vector along (dx, dy); up where there is no direction.
#[inline]
fn direction(dx: f64, dy: f64) -> Vector2<f64> {
    let length = dx.hypot(dy);
    if length > 0.0 {
        Vector2::new(dx / length, dy / length)
    } else {
        Vector2::y()
    }
}

impl SoilSystem<'_> {
    fn n(&self) -> usize {
        self.scene.disks.len()
    }

    /// Coordinates of the machine among all.
    fn own<'v>(&self, all: &'v [f64]) -> &'v [f64] {
        &all[3 * self.n()..]
    }

    fn pose(&self, q: &[f64]) -> SVector<f64, 5> {
        SVector::from_column_slice(self.own(q))
    }

    /// Adds the contacts of a disc with walls and ground. `velocity` of the rim point that faces along −n.
    #[allow(clippy::too_many_arguments)] // one disc: who, where, how large, how fast; and the rule
    fn meet_fixed(
        &mut self,
        a: u32,
        centre: Vector2<f64>,
        radius: f64,
        velocity: Vector2<f64>,
        reach: f64,
        admits: impl Fn(f64, f64) -> bool,
        out: &mut Vec<SoilContact>,
    ) {
        let mut push = |b: u32, n: Vector2<f64>, gap: f64| {
            if admits(gap, n.dot(&velocity)) {
                out.push(SoilContact {
                    key: SoilKey { a, b },
                    n,
                    point: centre - n * radius,
                    gap,
                    gap_start: gap,
                });
            }
        };
        for (k, wall) in (WALL..).zip(&self.scene.walls) {
            let gap = wall.distance(centre.x, centre.y) - radius;
            if gap <= reach {
                push(k, wall.n(), gap);
            }
        }
        if let Some(ground) = &self.scene.ground {
            let facing = &mut self.parts.facing;
            facing.clear();
            ground.facing(&centre, radius + reach, facing);
            for (k, facing) in (GROUND..).zip(&*facing) {
                push(k, facing.n, facing.distance - radius);
            }
        }
    }

    /// μ of a contact.
    fn friction_of(&self, key: SoilKey) -> f64 {
        let friction = &self.scene.friction;
        if key.a as usize >= self.n() {
            friction.wheels
        } else if key.b >= WALL {
            friction.walls
        } else {
            friction.disks
        }
    }

    /// The operator W of the last step's contacts, block by block, 1/kg.
    fn operator(&self) -> &BlockSparseDelassus {
        self.parts.operator.get_or_init(|| {
            let pairs = &self.parts.pairs;
            let wide = pairs.wide_at / 3;
            let side = |pair: &DiscPair, k: usize| {
                let ([x, y], c, s) = (pair.n, pair.linear[k], pair.angular[k]);
                let c = if k == 0 { c } else { -c };
                let body = (pair.linear[k] > 0.0).then_some(pair.bodies[k] as usize / 3);
                (
                    body,
                    [[c * x, c * y, 0.0, 0.0, 0.0], [c * y, -c * x, s, 0.0, 0.0]],
                )
            };
            let discs = pairs.discs.iter().map(|pair| {
                let ((a, Ja), (b, Jb)) = (side(pair, 0), side(pair, 1));
                PairContact {
                    bodies: [a, b],
                    jacobians: [Ja, Jb],
                }
            });
            let wheels = pairs.wide.iter().map(|pair| {
                let (b, Jb) = side(&pair.disc, 1);
                PairContact {
                    bodies: [Some(wide), b],
                    jacobians: [pair.rows, Jb],
                }
            });
            let contacts: Vec<PairContact<2, WIDE>> = discs.chain(wheels).collect();
            let mut operator = BlockSparseDelassus::new();
            operator.assemble(&contacts, &vec![[1.0; WIDE]; wide + 1]);
            operator
        })
    }
}

/// Its energy is not audited: frames stay where the step begins and disks have no gyroscopic terms, so that a step with θ ≥ ½ is passive by
/// construction.
impl MechanicalSystem for SoilSystem<'_> {
    /// (x, y, θ) of each disk, then the machine's coordinates, m and rad.
    type Configuration = Vec<f64>;
    type Contact = SoilContact;

    const DIMENSION: Dimension = Dimension::Two;

    fn nv(&self) -> usize {
        self.scene.nv()
    }

    fn set_moved(&self, from: &Vec<f64>, v: &[f64], h: f64, to: &mut Vec<f64>) {
        to.clear();
        to.extend(from.iter().zip(v).map(|(from, v)| from + h * v));
    }

    fn advance(&self, q: &mut Vec<f64>, v: &[f64], h: f64) {
        for (q, v) in q.iter_mut().zip(v) {
            *q += h * v;
        }
    }

    fn is_finite(&self, q: &Vec<f64>) -> bool {
        q.iter().all(|x| x.is_finite())
    }

    fn place_middle(&mut self, q: &Vec<f64>) {
        self.parts.middle.clone_from(q);
    }

    fn place_end(&mut self, q: &Vec<f64>) {
        self.parts.end.clone_from(q);
    }

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<SoilContact>) {
        out.clear();
        let n = self.n();
        let q = std::mem::take(&mut self.parts.middle);
        let mut found = std::mem::take(&mut self.parts.found);
        let mut grid = std::mem::take(&mut self.parts.grid);
        let scene = self.scene;
        let (radius, largest) = (scene.disks.radius(), scene.disks.largest());
        let lead = activation.lead.abs();
        let mut fastest = v[..3 * n]
            .chunks_exact(3)
            .zip(radius)
            .map(|(v, r)| v[0].abs() + v[1].abs() + r * v[2].abs())
            .fold(0.0, f64::max);
        let machine = scene.machine.as_deref();
        let (pose, rate) = match machine {
            Some(_) => (self.pose(&q), self.pose(v)),
            None => (SVector::zeros(), SVector::zeros()),
        };
        let mut wheels = Vec::new();
        if let Some(machine) = machine {
            for k in 0..machine.n_discs() {
                let disc = machine.disc(k, &pose);
                let velocity = machine.point_jacobian(k, &pose, &disc.centre) * rate;
                fastest = fastest.max(velocity.norm());
                wheels.push((disc, velocity));
            }
        }
        // What the fastest can be thrown at within the step is a contact too, though it comes no nearer yet.
        let smallest = scene.disks.smallest();
        let skin = (SKIN * smallest)
            .max(lead * fastest)
            .min(FARTHEST_SKIN * smallest);
        let skin = skin.max(activation.hover);
        // Two bodies close by at most twice that; farther than a diameter nobody looks (a step that long is too long).
        let reach = (skin + 2.0 * lead * fastest).min(2.0 * largest);
        grid.fill(&q, radius, 2.0 * largest + reach);
        let admits = |gap: f64, u_N: f64| gap + lead * u_N.min(0.0) <= skin;
        #[allow(clippy::cast_possible_truncation)] // disks are numbered by u32
        for i in 0..n as u32 {
            let at = 3 * i as usize;
            let (x, y, r) = (q[at], q[at + 1], radius[i as usize]);
            gather(&grid, [x, y], r, reach, largest, Some(i), &mut found);
            let sleeps = self.asleep[i as usize];
            for &(j, [gap, dx, dy]) in &found {
                if sleeps && self.asleep[j as usize] {
                    continue;
                }
                let n = direction(dx, dy);
                let k = 3 * j as usize;
                let u_N = n.x * (v[at] - v[k]) + n.y * (v[at + 1] - v[k + 1]);
                if admits(gap, u_N) {
                    out.push(SoilContact {
                        key: SoilKey { a: i, b: j },
                        n,
                        point: Vector2::new(x - n.x * r, y - n.y * r),
                        gap,
                        gap_start: gap,
                    });
                }
            }
            if !sleeps {
                let velocity = Vector2::new(v[at], v[at + 1]);
                self.meet_fixed(i, Vector2::new(x, y), r, velocity, reach, admits, out);
            }
        }
        #[allow(clippy::cast_possible_truncation)]
        for (a, (disc, velocity)) in (n as u32..).zip(&wheels) {
            let centre = disc.centre;
            gather(
                &grid,
                centre.into(),
                disc.radius,
                reach,
                largest,
                None,
                &mut found,
            );
            for &(j, [gap, dx, dy]) in &found {
                let n = direction(dx, dy);
                let k = 3 * j as usize;
                let u_N = n.dot(&(velocity - Vector2::new(v[k], v[k + 1])));
                if admits(gap, u_N) {
                    out.push(SoilContact {
                        key: SoilKey { a, b: j },
                        n,
                        point: centre - n * disc.radius,
                        gap,
                        gap_start: gap,
                    });
                }
            }
            self.meet_fixed(a, centre, disc.radius, *velocity, reach, admits, out);
        }
        self.parts.middle = q;
        self.parts.found = found;
        self.parts.grid = grid;
    }

    /// Frames stay where the step begins; the gap becomes the one that the velocities before the step lead to.
    fn relocate(&mut self, contacts: &mut [SoilContact]) {
        let n = self.n();
        let (middle, end) = (&self.parts.middle, &self.parts.end);
        let machine = self.scene.machine.as_deref();
        let wheels: Vec<Vector2<f64>> = machine.map_or_else(Vec::new, |machine| {
            let (from, to) = (self.pose(middle), self.pose(end));
            let moved = |k| machine.disc(k, &to).centre - machine.disc(k, &from).centre;
            (0..machine.n_discs()).map(moved).collect()
        });
        let moved = |body: u32| {
            let body = body as usize;
            if body < n {
                let k = 3 * body;
                Vector2::new(end[k] - middle[k], end[k + 1] - middle[k + 1])
            } else {
                wheels.get(body - n).copied().unwrap_or_default()
            }
        };
        for contact in contacts {
            let mut motion = moved(contact.key.a);
            if contact.is_with_disk() {
                motion -= moved(contact.key.b);
            }
            contact.gap = contact.gap_start + contact.n.dot(&motion);
        }
    }

    fn friction_coefficient(&self, _options: &StepOptions, contact: &SoilContact) -> f64 {
        self.friction_of(contact.key)
    }

    fn update_mass_matrix(&mut self, _options: &StepOptions) {
        if let Some(machine) = &self.scene.machine {
            let pose = self.pose(&self.parts.middle);
            self.parts.mass = machine.mass_matrix(&pose);
        }
    }

    fn factorise(&mut self, _options: &StepOptions) -> bool {
        if self.scene.machine.is_none() {
            return true;
        }
        match Cholesky::new(self.parts.mass) {
            Some(factor) => {
                self.parts.L = factor.l();
                true
            }
            None => false,
        }
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let disks = &self.scene.disks;
        let rows = v.chunks_exact(3).zip(out.chunks_exact_mut(3));
        for ((v, out), [m, J]) in rows.zip(&disks.roots) {
            out[0] = m * m * v[0];
            out[1] = m * m * v[1];
            out[2] = J * J * v[2];
        }
        if self.scene.machine.is_some() {
            let momentum = self.parts.mass * self.pose(v);
            out[3 * self.n()..].copy_from_slice(momentum.as_slice());
        }
    }

    fn load(
        &mut self,
        options: &StepOptions,
        _start: Start<'_, Vec<f64>>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let h = options.time_step;
        let gravity = options.gravity.xy();
        let masses = self.scene.disks.mass().iter().zip(self.asleep);
        for (y, (m, sleeps)) in y.chunks_exact_mut(3).zip(masses) {
            let m = if *sleeps { 0.0 } else { *m };
            y[0] = h * m * gravity.x;
            y[1] = h * m * gravity.y;
            y[2] = 0.0;
        }
        if let Some(machine) = &self.scene.machine {
            let pose = self.pose(&self.parts.middle);
            let rate = self.pose(v_mean);
            let mut force = machine.force(&pose, &rate, &gravity, self.inputs);
            force[0] += self.pull.x;
            force[1] += self.pull.y;
            y[3 * self.n()..].copy_from_slice((force * h).as_slice());
        }
    }

    fn half_solve(&self, y: &mut [f64]) {
        for (y, [m, J]) in y.chunks_exact_mut(3).zip(&self.scene.disks.roots) {
            y[0] /= m;
            y[1] /= m;
            y[2] /= J;
        }
        if self.scene.machine.is_some() {
            let at = 3 * self.n();
            forward(&self.parts.L, &mut y[at..]);
        }
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        for (y, [m, J]) in y.chunks_exact_mut(3).zip(&self.scene.disks.roots) {
            y[0] /= m;
            y[1] /= m;
            y[2] /= J;
        }
        if self.scene.machine.is_some() {
            let at = 3 * self.n();
            let (L, y) = (&self.parts.L, &mut y[at..]);
            for i in (0..5).rev() {
                let known: f64 = (i + 1..5).map(|k| L[(k, i)] * y[k]).sum();
                y[i] = (y[i] - known) / L[(i, i)];
            }
        }
    }

    fn assemble(&mut self, contacts: &[SoilContact], v: &[f64], u: &mut [f64]) {
        let n = self.n();
        let scene = self.scene;
        let pose = match scene.machine {
            Some(_) => self.pose(&self.parts.middle),
            None => SVector::zeros(),
        };
        let parts = &mut *self.parts;
        let pairs = &mut parts.pairs;
        pairs.discs.clear();
        pairs.wide.clear();
        parts.rows.clear();
        (pairs.wide_at, pairs.n_coordinates) = (3 * n, scene.nv());
        parts.operator.take();
        let asleep = self.asleep;
        let side = |body: u32| {
            let i = body as usize;
            if i < n && !asleep[i] {
                (3 * body, scene.disks.linear[i], scene.disks.angular[i])
            } else {
                (NOWHERE, 0.0, 0.0)
            }
        };
        for contact in contacts {
            let SoilKey { a, b } = contact.key;
            // A wheel is none of the disks: its side of the pair holds nothing.
            let (at_a, c_a, s_a) = side(a);
            let (at_b, c_b, s_b) = side(b);
            let pair = DiscPair {
                bodies: [at_a, at_b],
                n: [contact.n.x, contact.n.y],
                linear: [c_a, c_b],
                angular: [s_a, s_b],
            };
            if (a as usize) < n {
                pairs.discs.push(pair);
            } else if let Some(machine) = &scene.machine {
                let J = machine.point_jacobian(a as usize - n, &pose, &contact.point);
                let rows = [J.tr_mul(&contact.n), J.tr_mul(&contact.t())];
                parts.rows.push(rows);
                let scaled = rows.map(|mut row| {
                    forward(&parts.L, row.as_mut_slice());
                    row.into()
                });
                pairs.wide.push(WidePair {
                    rows: scaled,
                    disc: pair,
                });
            }
        }
        u.fill(0.0);
        self.add_local_of_velocity(contacts, v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        self.parts.pairs.local(y, out);
    }

    fn add_local_of_velocity(&self, contacts: &[SoilContact], v: &[f64], out: &mut [f64]) {
        let n = self.n();
        let radius = self.scene.disks.radius();
        let own = match self.scene.machine {
            Some(_) => self.pose(v),
            None => SVector::zeros(),
        };
        let mut rows = self.parts.rows.iter();
        for (contact, out) in contacts.iter().zip(out.chunks_exact_mut(2)) {
            let mut u = Vector2::zeros();
            let (a, b) = (contact.key.a as usize, contact.key.b as usize);
            if a < n {
                u += rim_velocity(&v[3 * a..3 * a + 3], radius[a], &contact.n);
            }
            if contact.is_with_disk() {
                u -= rim_velocity(&v[3 * b..3 * b + 3], -radius[b], &contact.n);
            }
            out[0] += contact.n.dot(&u);
            out[1] += contact.t().dot(&u);
            if a >= n
                && let Some([normal, tangent]) = rows.next()
            {
                out[0] += normal.dot(&own);
                out[1] += tangent.dot(&own);
            }
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        self.parts.pairs.add_impulses(p, y);
    }

    fn generalized_impulse(&self, contacts: &[SoilContact], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let n = self.n();
        let radius = self.scene.disks.radius();
        let mut rows = self.parts.rows.iter();
        for (contact, p) in contacts.iter().zip(p.chunks_exact(2)) {
            let force = contact.n * p[0] + contact.t() * p[1];
            let (a, b) = (contact.key.a as usize, contact.key.b as usize);
            let mut add = |body: usize, sign: f64| {
                out[3 * body] += sign * force.x;
                out[3 * body + 1] += sign * force.y;
                out[3 * body + 2] += radius[body] * p[1];
            };
            if a < n {
                add(a, 1.0);
            }
            if contact.is_with_disk() {
                add(b, -1.0);
            }
            if a >= n
                && let Some([normal, tangent]) = rows.next()
            {
                for k in 0..5 {
                    out[3 * n + k] += normal[k] * p[0] + tangent[k] * p[1];
                }
            }
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(self.operator(), q, mu)
    }

    /// Newton's law for a pair that comes together fast within the step; any other may close by its gap.
    ///
    /// With `e u_N⁻ + s` and any s ≥ 0 a frictionless impact gains no energy, see [`crate::law::newton_impact`]: here s is what the gap allows.
    fn normal_shift(&self, options: &StepOptions, contact: &SoilContact, u_N_before: f64) -> f64 {
        let h = options.time_step;
        let gap = contact.gap_start.max(0.0);
        let rebound = options.restitution * u_N_before;
        let slow = 2.0 * options.gravity.norm() * h;
        if rebound < 0.0 && u_N_before < -slow && gap + h * u_N_before <= 0.0 {
            rebound
        } else {
            gap / h + rebound.max(0.0)
        }
    }

    /// Its sweeps end at a loose tolerance, and a pile that bounces needs many.
    fn solves_to_the_end(&self) -> bool {
        false
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
        let bodies = ManyBodies {
            pairs: &self.parts.pairs,
            q,
            mu,
            operator: &|| self.operator(),
        };
        solve_many_bodies(&bodies, options, p, u, workspace)
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let arms = match &self.scene.machine {
            Some(machine) => machine.arms(),
            None => return 0.0,
        };
        let own = self.own(y).iter().zip(&arms);
        own.map(|(y, arm)| (y * arm).abs()).fold(0.0, f64::max)
    }
}

/// `y ← L⁻¹ y`.
fn forward(L: &SMatrix<f64, 5, 5>, y: &mut [f64]) {
    for i in 0..5 {
        let known: f64 = (0..i).map(|k| L[(i, k)] * y[k]).sum();
        y[i] = (y[i] - known) / L[(i, i)];
    }
}
