//! Free spheres over a plane in space, by the rover's own time stepping.
//!
//! M is diagonal, each sphere touches a handful of others, so W is assembled block-sparse and the solver works island by
//! island. A homogeneous sphere looks the same from all sides: configurations hold centres, velocities the six components of each sphere
//! (centre, m/s; spin in world axes, rad/s), and there is no gyroscopic term.

use rover_core::contact::{Activation, ContactFrame};
use rover_core::integrator::{
    Integrator, MechanicalSystem, NoProbe, OptionsError, Scratch, Start, StateMut, StepError,
    StepOptions, StepReport, UnilateralContact, WarmStart,
};
use rover_core::nalgebra::Vector3;
use rover_core::problem::{BlockSparseDelassus, Dimension, FrictionContactProblem, PairContact};

use crate::cell_grid::CellGrid;

/// Velocities of a sphere.
const NV: usize = 6;

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

    /// M of each velocity of a sphere: kg, kg m².
    fn masses(&self) -> [f64; NV] {
        let (m, i) = (self.mass, self.inertia());
        [m, m, m, i, i, i]
    }
}

/// A contact of two spheres, or of one with the plane y = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereContact {
    /// The two spheres, ascending; the second is [`PLANE`] for the plane.
    pub key: (u32, u32),
    /// n from the second to the first.
    pub frame: ContactFrame,
    /// m.
    pub gap: f64,
}

impl SphereContact {
    fn first(&self) -> usize {
        self.key.0 as usize
    }

    /// The second sphere, `None` for the plane.
    fn second(&self) -> Option<usize> {
        (self.key.1 != PLANE).then_some(self.key.1 as usize)
    }

    fn measure(&mut self, centres: &[Vector3<f64>], radius: f64) {
        (self.gap, self.frame.n) = match self.second() {
            None => (centres[self.first()].y - radius, Vector3::y()),
            Some(j) => apart(&centres[self.first()], &centres[j], radius),
        };
    }
}

/// Gap, and direction from b to a.
fn apart(a: &Vector3<f64>, b: &Vector3<f64>, radius: f64) -> (f64, Vector3<f64>) {
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

impl UnilateralContact for SphereContact {
    type Key = (u32, u32);

    fn key(&self) -> (u32, u32) {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// Poses and matrices of a step: scratch.
#[derive(Clone, Debug, Default)]
pub struct SphereScratch {
    middle: Vec<Vector3<f64>>,
    end: Vec<Vector3<f64>>,
    grid: CellGrid,
    rows: Vec<PairContact<3, NV>>,
    inverse_masses: Vec<[f64; NV]>,
    W: BlockSparseDelassus,
}

/// Spheres over the plane y = 0.
#[derive(Debug)]
pub struct SphereSystem<'a> {
    /// Each of them.
    pub kind: SphereKind,
    /// How many.
    pub n: usize,
    /// Scratch.
    pub parts: &'a mut SphereScratch,
}

impl SphereSystem<'_> {
    /// Velocity of sphere i's centre, m/s.
    fn velocity(v: &[f64], i: usize) -> Vector3<f64> {
        Vector3::from_column_slice(&v[NV * i..NV * i + 3])
    }
}

/// `out[r] += rows[r] · v`.
fn add_product(rows: &[[f64; NV]; 3], v: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(rows) {
        *out += row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
    }
}

/// Adds `H p` in the order of the velocities, each sphere's part divided by `scale`.
fn add_transposed(contacts: &[PairContact<3, NV>], p: &[f64], scale: &[f64; NV], out: &mut [f64]) {
    for (contact, p) in contacts.iter().zip(p.chunks_exact(3)) {
        for (body, rows) in contact.bodies.iter().zip(&contact.jacobians) {
            let Some(body) = body else { continue };
            let out = &mut out[NV * body..NV * (body + 1)];
            for k in 0..NV {
                let sum: f64 = rows.iter().zip(p).map(|(row, p)| row[k] * p).sum();
                out[k] += sum / scale[k];
            }
        }
    }
}

impl MechanicalSystem for SphereSystem<'_> {
    /// Centres, world, m.
    type Configuration = Vec<Vector3<f64>>;
    type Contact = SphereContact;

    const DIMENSION: Dimension = Dimension::Three;

    fn nv(&self) -> usize {
        NV * self.n
    }

    fn set_moved(&self, from: &Vec<Vector3<f64>>, v: &[f64], h: f64, to: &mut Vec<Vector3<f64>>) {
        to.clone_from(from);
        self.advance(to, v, h);
    }

    fn advance(&self, q: &mut Vec<Vector3<f64>>, v: &[f64], h: f64) {
        for (i, x) in q.iter_mut().enumerate() {
            *x += Self::velocity(v, i) * h;
        }
    }

    fn is_finite(&self, q: &Vec<Vector3<f64>>) -> bool {
        q.iter().flatten().all(|x| x.is_finite())
    }

    fn place_middle(&mut self, q: &Vec<Vector3<f64>>) {
        self.parts.middle.clone_from(q);
    }

    fn place_end(&mut self, q: &Vec<Vector3<f64>>) {
        self.parts.end.clone_from(q);
    }

    fn detect(&mut self, v: &[f64], mut activation: Activation, out: &mut Vec<SphereContact>) {
        out.clear();
        let radius = self.kind.radius;
        let fastest = (0..self.n).fold(0.0_f64, |m, i| m.max(Self::velocity(v, i).norm()));
        activation.margin = 2.0 * activation.lead.abs() * fastest;
        let reach = activation.reach();
        let SphereScratch { middle, grid, .. } = &mut *self.parts;
        let name = |i: usize| u32::try_from(i).unwrap_or(PLANE);
        let mut offer =
            |i: usize, second: u32, gap: f64, n: Vector3<f64>, velocity: Vector3<f64>| {
                if gap <= reach && activation.admits(gap, || n.dot(&velocity)) {
                    out.push(SphereContact {
                        key: (name(i), second),
                        frame: ContactFrame::of_normal(&n),
                        gap,
                    });
                }
            };
        for (i, x) in middle.iter().enumerate() {
            offer(i, PLANE, x.y - radius, Vector3::y(), Self::velocity(v, i));
        }
        grid.visit_pairs(middle, 2.0 * radius + reach, |i, j| {
            let (i, j) = (i.min(j), i.max(j));
            let (gap, n) = apart(&middle[i], &middle[j], radius);
            offer(
                i,
                name(j),
                gap,
                n,
                Self::velocity(v, i) - Self::velocity(v, j),
            );
        });
        out.sort_unstable_by_key(|contact| contact.key);
    }

    fn relocate(&mut self, contacts: &mut [SphereContact]) {
        for contact in contacts {
            contact.measure(&self.parts.end, self.kind.radius);
            contact.frame = ContactFrame::of_normal(&contact.frame.n);
        }
    }

    fn update_mass_matrix(&mut self, _options: &StepOptions) {
        let inverse = self.kind.masses().map(f64::recip);
        self.parts.inverse_masses.resize(self.n, inverse);
    }

    fn factorise(&mut self, _options: &StepOptions) -> bool {
        self.kind.masses().iter().all(|m| *m > 0.0)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let masses = self.kind.masses();
        for (out, v) in out.chunks_exact_mut(NV).zip(v.chunks_exact(NV)) {
            for k in 0..NV {
                out[k] = masses[k] * v[k];
            }
        }
    }

    fn load(
        &mut self,
        options: &StepOptions,
        _start: Start<'_, Vec<Vector3<f64>>>,
        _v_mean: &[f64],
        y: &mut [f64],
    ) {
        let weight = options.gravity * (self.kind.mass * options.time_step);
        for y in y.chunks_exact_mut(NV) {
            y[..3].copy_from_slice(weight.as_slice());
            y[3..].fill(0.0);
        }
    }

    fn half_solve(&self, y: &mut [f64]) {
        let roots = self.kind.masses().map(f64::sqrt);
        for y in y.chunks_exact_mut(NV) {
            for k in 0..NV {
                y[k] /= roots[k];
            }
        }
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        self.half_solve(y);
    }

    fn assemble(&mut self, contacts: &[SphereContact], v: &[f64], u: &mut [f64]) {
        let radius = self.kind.radius;
        let parts = &mut *self.parts;
        parts.rows.clear();
        parts.rows.extend(contacts.iter().map(|contact| {
            let ContactFrame { n, t, b } = contact.frame;
            // d · (ω × r) = ω · (r × d), with r = −R n on the first sphere and R n on the second: the same row for both spins.
            let spins = [Vector3::zeros(), b * radius, -t * radius];
            let side = |sign: f64| {
                [0, 1, 2].map(|r| {
                    let (d, s) = ([n, t, b][r] * sign, spins[r]);
                    [d.x, d.y, d.z, s.x, s.y, s.z]
                })
            };
            PairContact {
                bodies: [Some(contact.first()), contact.second()],
                jacobians: [side(1.0), side(-1.0)],
            }
        }));
        parts.W.assemble(&parts.rows, &parts.inverse_masses);
        u.fill(0.0);
        self.add_local_of_velocity(contacts, v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let roots = self.kind.masses().map(f64::sqrt);
        out.fill(0.0);
        for (contact, out) in self.parts.rows.iter().zip(out.chunks_exact_mut(3)) {
            for (body, rows) in contact.bodies.iter().zip(&contact.jacobians) {
                if let Some(body) = body {
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
        let roots = self.kind.masses().map(f64::sqrt);
        add_transposed(&self.parts.rows, p, &roots, y);
    }

    fn generalized_impulse(&self, _contacts: &[SphereContact], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        add_transposed(&self.parts.rows, p, &[1.0; NV], out);
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(&self.parts.W, q, mu)
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        (0..self.n).fold(0.0, |m, i| Self::velocity(y, i).norm().max(m))
    }
}

/// Overlap of the spheres with one another and with the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Sum of the squared depths, m².
    pub sum_of_squares: f64,
    /// m.
    pub deepest: f64,
}

/// Spheres over the plane y = 0, stepped through time.
#[derive(Clone, Debug)]
pub struct SphereSimulation {
    kind: SphereKind,
    options: StepOptions,
    centres: Vec<Vector3<f64>>,
    v: Vec<f64>,
    time: f64,
    warm_start: WarmStart<(u32, u32)>,
    parts: SphereScratch,
    scratch: Scratch<Vec<Vector3<f64>>, SphereContact>,
    grid: CellGrid,
}

impl SphereSimulation {
    /// At rest with these centres, m.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        kind: SphereKind,
        centres: Vec<Vector3<f64>>,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        options.check()?;
        let nv = NV * centres.len();
        Ok(Self {
            kind,
            options,
            v: vec![0.0; nv],
            time: 0.0,
            warm_start: WarmStart::default(),
            parts: SphereScratch::default(),
            scratch: Scratch::new(&centres, nv, 4 * centres.len(), 3),
            grid: CellGrid::default(),
            centres,
        })
    }

    /// Centres, m.
    #[must_use]
    pub fn centres(&self) -> &[Vector3<f64>] {
        &self.centres
    }

    /// Six velocities of each sphere, m/s and rad/s.
    #[must_use]
    pub fn v(&self) -> &[f64] {
        &self.v
    }

    /// The same, to be set.
    pub fn v_mut(&mut self) -> &mut [f64] {
        self.warm_start.clear();
        &mut self.v
    }

    /// s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The last step's operator W, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &BlockSparseDelassus {
        &self.parts.W
    }

    /// Contacts of the last step.
    #[must_use]
    pub fn contacts(&self) -> &[SphereContact] {
        self.scratch.contacts()
    }

    /// Takes `n` steps, or stops at the first that fails, keeping the state before it.
    ///
    /// # Errors
    /// See [`StepError`]. A solver that did not converge is no error: see the report.
    pub fn step(&mut self, n: usize) -> Result<StepReport, StepError> {
        let mut total = StepReport::default();
        for _ in 0..n {
            let mut system = SphereSystem {
                kind: self.kind,
                n: self.centres.len(),
                parts: &mut self.parts,
            };
            let state = StateMut {
                configuration: &mut self.centres,
                v: &mut self.v,
                time: &mut self.time,
            };
            let report = self.options.variant.step(
                &mut system,
                &self.options,
                state,
                &mut self.warm_start,
                &mut self.scratch,
                &mut NoProbe,
            )?;
            total.merge(&report);
        }
        Ok(total)
    }

    /// Kinetic and potential energy (0 with all centres in the plane), J.
    #[must_use]
    pub fn energy(&self) -> f64 {
        let masses = self.kind.masses();
        let of_sphere = |(x, v): (&Vector3<f64>, &[f64])| {
            let kinetic: f64 = (0..NV).map(|k| 0.5 * masses[k] * v[k] * v[k]).sum();
            kinetic - self.kind.mass * self.options.gravity.dot(x)
        };
        self.centres
            .iter()
            .zip(self.v.chunks_exact(NV))
            .map(of_sphere)
            .sum()
    }

    /// Linear momentum, N s.
    #[must_use]
    pub fn momentum(&self) -> Vector3<f64> {
        let velocities = self.v.chunks_exact(NV);
        velocities
            .map(|v| Vector3::from_column_slice(&v[..3]) * self.kind.mass)
            .sum()
    }

    /// Angular momentum about the origin, N m s.
    #[must_use]
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let of_sphere = |(x, v): (&Vector3<f64>, &[f64])| {
            let linear = Vector3::from_column_slice(&v[..3]) * self.kind.mass;
            x.cross(&linear) + Vector3::from_column_slice(&v[3..]) * self.kind.inertia()
        };
        self.centres
            .iter()
            .zip(self.v.chunks_exact(NV))
            .map(of_sphere)
            .sum()
    }

    /// Every overlap now, of spheres that were contacts or not.
    pub fn penetration(&mut self) -> Penetration {
        let mut found = Penetration::default();
        let mut enter = |depth: f64| {
            if depth > 0.0 {
                found.sum_of_squares += depth * depth;
                found.deepest = found.deepest.max(depth);
            }
        };
        let (centres, radius) = (&self.centres, self.kind.radius);
        for x in centres {
            enter(radius - x.y);
        }
        self.grid.visit_pairs(centres, 2.0 * radius, |i, j| {
            enter(2.0 * radius - (centres[i] - centres[j]).norm());
        });
        found
    }
}
