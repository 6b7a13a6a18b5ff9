//! Free spheres over a plane in space, optionally with a box, under the rover's own time stepping.
//!
//! M is diagonal and each body touches a handful of others, so W is assembled block-sparse and the
//! solver works island by island. A homogeneous sphere looks the same from all sides:
//! configurations hold its centre, velocities six components (centre, m/s; spin in world axes,
//! rad/s), and there is no gyroscopic term. The box, the last of the bodies where there is one, has
//! an attitude, spins in its own axes, and touches the plane with its corners.

use rover_core::contact::{Activation, ContactFrame};
use rover_core::integrator::{
    Dynamics, Forces, MechanicalSystem, StepOptions, StepStart, UnilateralContact,
};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::problem::{BlockSparseDelassus, Dimension, FrictionContactProblem, PairContact};
use rover_core::system::grains::grid::Grid;

use crate::slab::{CORNERS, Slab};

/// Velocities of a body.
pub(crate) const NV: usize = 6;

/// The second name of a contact with the plane.
pub const PLANE: u32 = u32::MAX;

/// What a sphere is made of; all are alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereKind {
    /// kg.
    pub mass: f64,
    /// m.
    pub radius: f64,
}

impl SphereKind {
    /// Moment of inertia of the homogeneous sphere, kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        0.4 * self.mass * self.radius * self.radius
    }
}

/// All bodies there are.
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    /// Mass and radius of each sphere.
    pub kind: SphereKind,
    /// How many spheres.
    pub n: usize,
    /// The box, which is body `n`.
    pub slab: Option<Slab>,
}

impl Bodies {
    /// Spheres, and the box.
    #[must_use]
    pub fn count(&self) -> usize {
        self.n + usize::from(self.slab.is_some())
    }

    /// The diagonal of M for one body: kg, kg m².
    #[must_use]
    pub fn masses(&self, body: usize) -> [f64; NV] {
        let (m, i) = match &self.slab {
            Some(slab) if body == self.n => (slab.mass, slab.inertia()),
            _ => (self.kind.mass, Vector3::repeat(self.kind.inertia())),
        };
        [m, m, m, i.x, i.y, i.z]
    }
}

/// Where the bodies are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPlacement {
    /// Centres of the bodies, the box last, world, m.
    pub centres: Vec<Vector3<f64>>,
    /// Attitude of the box.
    pub turn: UnitQuaternion<f64>,
}

/// A contact of two bodies, or of one with the plane y = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereContact {
    /// The two bodies, ascending, where corner k of the box counts as body
    /// n + k; the second is [`PLANE`] for the plane.
    pub key: (u32, u32),
    /// The two bodies; `None` is the plane.
    pub bodies: [Option<usize>; 2],
    /// n from the second to the first.
    pub frame: ContactFrame,
    /// m.
    pub gap: f64,
    /// From each body's centre to where it touches, world, m.
    pub arms: [Vector3<f64>; 2],
}

impl UnilateralContact for SphereContact {
    type Key = (u32, u32);
    type Local = [f64; 3];

    fn key(&self) -> (u32, u32) {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// Pairs of close points, found by the grid of the core's grains: its
/// memory, kept from one search to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pairs {
    grid: Grid<3>,
    coordinates: Vec<f64>,
    sizes: Vec<f64>,
}

impl Pairs {
    /// Calls `visit(i, j)`, i < j, once for each pair that can be nearer than `size` (m, positive).
    pub fn visit(
        &mut self,
        points: &[Vector3<f64>],
        size: f64,
        mut visit: impl FnMut(usize, usize),
    ) {
        self.coordinates.clear();
        self.coordinates.extend(points.iter().flatten());
        self.sizes.clear();
        self.sizes.resize(points.len(), 0.5 * size);
        self.grid.fill(&self.coordinates, &self.sizes, size);
        for (i, point) in points.iter().enumerate() {
            self.grid.near(&(*point).into(), size, |other| {
                let j = other.index as usize;
                if j > i {
                    visit(i, j);
                }
            });
        }
    }
}

/// Gap, and direction from b to a.
pub(crate) fn apart(a: &Vector3<f64>, b: &Vector3<f64>, radius: f64) -> (f64, Vector3<f64>) {
    let between = a - b;
    let distance = between.norm();
    // Concentric spheres have no direction of their own.
    let n = if distance > 0.0 {
        between / distance
    } else {
        Vector3::y()
    };
    (distance - 2.0 * radius, n)
}

impl Bodies {
    /// Gap, normal and arms of the contact of a name.
    #[inline]
    fn measure(
        &self,
        at: &BodyPlacement,
        key: (u32, u32),
    ) -> (f64, Vector3<f64>, [Vector3<f64>; 2]) {
        let (i, j) = (key.0 as usize, key.1 as usize);
        let radius = self.kind.radius;
        let none = Vector3::zeros();
        match &self.slab {
            Some(slab) if i >= self.n => {
                let arm = at.turn * slab.corner(i - self.n);
                (at.centres[self.n].y + arm.y, Vector3::y(), [arm, none])
            }
            Some(slab) if j == self.n => {
                let x = at.centres[i] - at.centres[j];
                let (point, distance, n) = slab.nearest(&at.turn.inverse_transform_vector(&x));
                let n = at.turn * n;
                (distance - radius, n, [-n * radius, at.turn * point])
            }
            _ if key.1 == PLANE => {
                let n = Vector3::y();
                (at.centres[i].y - radius, n, [-n * radius, none])
            }
            _ => {
                let (gap, n) = apart(&at.centres[i], &at.centres[j], radius);
                (gap, n, [-n * radius, n * radius])
            }
        }
    }

    /// The bodies of a contact.
    fn of_contact(&self, key: (u32, u32)) -> [Option<usize>; 2] {
        let second = (key.1 != PLANE).then_some(key.1 as usize);
        [Some((key.0 as usize).min(self.n)), second]
    }

    /// Velocity of a body's point at an arm (world, m) as far as a normal there feels it: a
    /// sphere's spin moves no point along its normal.
    fn velocity_at(
        &self,
        v: &[f64],
        body: usize,
        arm: &Vector3<f64>,
        turn: &UnitQuaternion<f64>,
    ) -> Vector3<f64> {
        let linear = linear(v, body);
        if body < self.n {
            return linear;
        }
        linear + (turn * spin(v, body)).cross(arm)
    }

    /// No point of a body is faster than this, m/s.
    fn speed(&self, v: &[f64], body: usize) -> f64 {
        let turning = match &self.slab {
            Some(slab) if body == self.n => spin(v, body).norm() * slab.half.norm(),
            _ => 0.0,
        };
        linear(v, body).norm() + turning
    }
}

/// Velocity of a body's centre, m/s.
pub(crate) fn linear(v: &[f64], body: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&v[NV * body..NV * body + 3])
}

/// Spin of a body, rad/s.
pub(crate) fn spin(v: &[f64], body: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&v[NV * body + 3..NV * (body + 1)])
}

/// Poses and matrices of a step: scratch.
#[derive(Clone, Debug, Default)]
pub struct SphereScratch {
    middle: BodyPlacement,
    pub(crate) end: BodyPlacement,
    grid: Pairs,
    rows: Vec<PairContact<3, NV>>,
    inverse_masses: Vec<[f64; NV]>,
    /// Square roots of M's diagonal.
    roots: Vec<[f64; NV]>,
    pub(crate) W: BlockSparseDelassus,
}

/// Bodies over the plane y = 0.
#[derive(Debug)]
pub struct SphereSystem<'a> {
    /// What there is.
    pub bodies: &'a Bodies,
    /// Scratch.
    pub parts: &'a mut SphereScratch,
}

/// `out[r] += rows[r] · v`.
fn add_product(rows: &[[f64; NV]; 3], v: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(rows) {
        *out += row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
    }
}

/// Adds `H p` in the order of the velocities, each body's part divided by
/// its `scale`, where there is one.
fn add_transposed(
    contacts: &[PairContact<3, NV>],
    p: &[f64],
    scale: Option<&[[f64; NV]]>,
    out: &mut [f64],
) {
    for (contact, p) in contacts.iter().zip(p.chunks_exact(3)) {
        for (body, rows) in contact.bodies.iter().zip(&contact.jacobians) {
            let Some(body) = *body else { continue };
            let out = &mut out[NV * body..NV * (body + 1)];
            for k in 0..NV {
                let sum: f64 = rows.iter().zip(p).map(|(row, p)| row[k] * p).sum();
                out[k] += scale.map_or(sum, |scale| sum / scale[body][k]);
            }
        }
    }
}

impl Dynamics for SphereSystem<'_> {
    type T = f64;
    type Configuration = BodyPlacement;

    fn nv(&self) -> usize {
        NV * self.bodies.count()
    }

    fn set_moved(&self, from: &BodyPlacement, v: &[f64], h: f64, to: &mut BodyPlacement) {
        to.centres.clone_from(&from.centres);
        to.turn = from.turn;
        self.advance(to, v, h);
    }

    fn advance(&self, q: &mut BodyPlacement, v: &[f64], h: f64) {
        for (i, x) in q.centres.iter_mut().enumerate() {
            *x += linear(v, i) * h;
        }
        if self.bodies.slab.is_some() {
            q.turn *= UnitQuaternion::from_scaled_axis(spin(v, self.bodies.n) * h);
        }
    }

    fn is_finite(&self, q: &BodyPlacement) -> bool {
        let turn = q.turn.coords.iter();
        q.centres
            .iter()
            .flatten()
            .chain(turn)
            .all(|x| x.is_finite())
    }

    fn normalise(&self, q: &mut BodyPlacement) {
        q.turn.renormalize();
    }

    fn place_middle(&mut self, q: &BodyPlacement) {
        self.parts.middle.clone_from(q);
    }

    fn place_end(&mut self, q: &BodyPlacement) {
        self.parts.end.clone_from(q);
    }

    fn update_mass_matrix(&mut self, _options: &StepOptions, _: bool, _: bool) {
        let n = self.bodies.count();
        // Each sphere is like the others, and nothing here changes in a run.
        if self.parts.roots.len() != n {
            let masses = |body| self.bodies.masses(body);
            self.parts.inverse_masses = (0..n).map(|b| masses(b).map(f64::recip)).collect();
            self.parts.roots = (0..n).map(|b| masses(b).map(f64::sqrt)).collect();
        }
    }

    fn factorise(&mut self, _options: &StepOptions) -> bool {
        self.parts.roots.iter().flatten().all(|m| *m > 0.0)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let bodies = out.chunks_exact_mut(NV).zip(v.chunks_exact(NV));
        for (body, (out, v)) in bodies.enumerate() {
            let masses = self.bodies.masses(body);
            for k in 0..NV {
                out[k] = masses[k] * v[k];
            }
        }
    }

    fn half_solve(&self, y: &mut [f64]) {
        for (y, roots) in y.chunks_exact_mut(NV).zip(&self.parts.roots) {
            for k in 0..NV {
                y[k] /= roots[k];
            }
        }
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        self.half_solve(y);
    }

    fn displacement(&self, y: &[f64], _cluster: usize) -> f64 {
        (0..self.bodies.count()).fold(0.0, |m, i| self.bodies.speed(y, i).max(m))
    }
}

impl Forces for SphereSystem<'_> {
    fn load(
        &mut self,
        options: &StepOptions,
        _start: StepStart<'_, BodyPlacement>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let h = options.time_step;
        let weight = options.gravity * (self.bodies.kind.mass * h);
        for y in y.chunks_exact_mut(NV) {
            y[..3].copy_from_slice(weight.as_slice());
            y[3..].fill(0.0);
        }
        if let Some(slab) = &self.bodies.slab {
            let force = options.gravity * slab.mass + slab.push;
            let omega = spin(v_mean, self.bodies.n);
            let gyroscopic = slab.inertia().component_mul(&omega).cross(&omega);
            let y = &mut y[NV * self.bodies.n..];
            y[..3].copy_from_slice((force * h).as_slice());
            y[3..].copy_from_slice((gyroscopic * h).as_slice());
        }
    }
}

impl MechanicalSystem for SphereSystem<'_> {
    type Machine = Self;

    fn machine(&self) -> &Self {
        self
    }

    fn machine_mut(&mut self) -> &mut Self {
        self
    }

    type Contact = SphereContact;

    const DIMENSION: Dimension = Dimension::Three;

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<SphereContact>) {
        out.clear();
        let bodies = self.bodies;
        let n = bodies.n;
        let fastest = (0..bodies.count()).fold(0.0_f64, |m, i| m.max(bodies.speed(v, i)));
        let reach = activation.reach(|| 2.0 * fastest);
        let SphereScratch { middle, grid, .. } = &mut *self.parts;
        let name = |i: usize| u32::try_from(i).unwrap_or(PLANE);
        let mut offer = |key: (u32, u32)| {
            let (gap, normal, arms) = bodies.measure(middle, key);
            if gap > reach {
                return;
            }
            let of = bodies.of_contact(key);
            let approach = || {
                let velocity = |side: usize| {
                    of[side].map_or_else(Vector3::zeros, |body| {
                        bodies.velocity_at(v, body, &arms[side], &middle.turn)
                    })
                };
                normal.dot(&(velocity(0) - velocity(1)))
            };
            if activation.admits(gap, approach) {
                out.push(SphereContact {
                    key,
                    bodies: of,
                    frame: ContactFrame::of_normal(&normal),
                    gap,
                    arms,
                });
            }
        };
        for i in 0..n {
            offer((name(i), PLANE));
            if bodies.slab.is_some() {
                offer((name(i), name(n)));
            }
        }
        if bodies.slab.is_some() {
            for k in 0..CORNERS {
                offer((name(n + k), PLANE));
            }
        }
        let size = 2.0 * bodies.kind.radius + reach;
        grid.visit(&middle.centres[..n], size, |i, j| offer((name(i), name(j))));
        out.sort_unstable_by_key(|contact| contact.key);
    }

    fn relocate(&mut self, contacts: &mut [SphereContact]) {
        for contact in contacts {
            let (gap, n, arms) = self.bodies.measure(&self.parts.end, contact.key);
            contact.gap = gap;
            contact.frame = ContactFrame::of_normal(&n);
            contact.arms = arms;
        }
    }

    fn friction_coefficient(&self, options: &StepOptions, contact: &SphereContact) -> f64 {
        match &self.bodies.slab {
            Some(slab) if contact.bodies[1].is_some_and(|b| b == self.bodies.n) => slab.friction,
            _ => options.friction_coefficient,
        }
    }

    fn assemble(&mut self, contacts: &[SphereContact], v: &[f64], u: &mut [f64]) {
        let n = self.bodies.n;
        let parts = &mut *self.parts;
        let turn = parts.end.turn;
        parts.rows.clear();
        parts.rows.extend(contacts.iter().map(|contact| {
            let directions = contact.frame.rows();
            // d · (ω × r) = ω · (r × d), and the box spins in its own axes.
            let side = |side: usize, sign: f64| {
                let is_slab = contact.bodies[side].is_some_and(|body| body == n);
                directions.map(|d| {
                    let d = d * sign;
                    let moment = contact.arms[side].cross(&d);
                    let s = if is_slab {
                        turn.inverse_transform_vector(&moment)
                    } else {
                        moment
                    };
                    [d.x, d.y, d.z, s.x, s.y, s.z]
                })
            };
            PairContact {
                bodies: contact.bodies,
                jacobians: [side(0, 1.0), side(1, -1.0)],
            }
        }));
        parts.W.assemble(&parts.rows, &parts.inverse_masses);
        u.fill(0.0);
        self.add_local_of_velocity(contacts, v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (contact, out) in self.parts.rows.iter().zip(out.chunks_exact_mut(3)) {
            for (body, rows) in contact.bodies.iter().zip(&contact.jacobians) {
                if let Some(body) = *body {
                    let roots = &self.parts.roots[body];
                    let velocity: [f64; NV] = std::array::from_fn(|k| y[NV * body + k] / roots[k]);
                    add_product(rows, &velocity, out);
                }
            }
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[SphereContact], v: &[f64], out: &mut [f64]) {
        for (contact, out) in self.parts.rows.iter().zip(out.chunks_exact_mut(3)) {
            for (body, rows) in contact.bodies.iter().zip(&contact.jacobians) {
                if let Some(body) = body {
                    add_product(rows, &v[NV * body..NV * (body + 1)], out);
                }
            }
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        add_transposed(&self.parts.rows, p, Some(&self.parts.roots), y);
    }

    fn generalized_impulse(&self, _contacts: &[SphereContact], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        add_transposed(&self.parts.rows, p, None, out);
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(&self.parts.W, q, mu)
    }
}
