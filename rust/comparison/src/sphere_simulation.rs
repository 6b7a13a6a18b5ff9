//! Simulation of free spheres, optionally with a box.

use std::hash::{DefaultHasher, Hasher};

use rover_core::integrator::{OptionsError, StepError, StepOptions, StepReport};
use rover_core::multibody::Energy;
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::problem::BlockSparseDelassus;
use rover_core::simulation::{ActiveContact, LocatedContact, Scene, Simulation, Snapshot, State};

use crate::Stepper;
use crate::free_spheres::{
    Bodies, BodyPlacement, NV, Pairs, SphereContact, SphereKind, SphereScratch, SphereSystem,
    apart, linear, spin,
};
use crate::slab::{CORNERS, Slab};

/// Overlap of the bodies with one another and with the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Sum of the squared depths, m².
    pub sum_of_squares: f64,
    /// m.
    pub deepest: f64,
}

impl LocatedContact for SphereContact {
    fn normal(&self) -> [f64; 3] {
        self.frame.rows()[0].into()
    }

    fn is_finite(&self) -> bool {
        let [n, t, b] = self.frame.rows();
        let [first, second] = &self.arms;
        let numbers = [&n, &t, &b, first, second].into_iter().flatten();
        numbers.chain([&self.gap]).all(|x| x.is_finite())
    }
}

impl Scene for Bodies {
    type Configuration = BodyPlacement;
    type Moved = BodyPlacement;
    type Contact = SphereContact;
    type Command = ();
    type Memory = ();
    type Parts = SphereScratch;
    type System<'a> = SphereSystem<'a>;

    fn nv(&self) -> usize {
        NV * self.count()
    }

    fn moved(&self, q: &BodyPlacement) -> BodyPlacement {
        q.clone()
    }

    fn command(&self) {}

    fn memory(&self) {}

    fn parts(&self) -> SphereScratch {
        SphereScratch::default()
    }

    fn contact_capacity(&self) -> usize {
        4 * self.n
    }

    fn system<'a>(
        &'a self,
        _: &StepOptions,
        (): &'a (),
        (): &'a mut (),
        parts: &'a mut SphereScratch,
    ) -> SphereSystem<'a> {
        SphereSystem {
            bodies: self,
            parts,
        }
    }

    fn position(&self, parts: &SphereScratch, contact: &SphereContact) -> [f64; 3] {
        let body = contact.bodies[0].unwrap_or(self.n);
        (parts.end.centres[body] + contact.arms[0]).into()
    }

    /// The potential is 0 with all centres in the plane.
    fn energy(
        &self,
        options: &StepOptions,
        state: &State<BodyPlacement>,
        _command: &Self::Command,
    ) -> Energy {
        let mut energy = Energy::default();
        for (body, centre) in state.configuration.centres.iter().enumerate() {
            let masses = self.masses(body);
            let v = &state.v[NV * body..NV * (body + 1)];
            energy.kinetic += (0..NV).map(|k| 0.5 * masses[k] * v[k] * v[k]).sum::<f64>();
            energy.potential -= masses[0] * options.gravity.dot(centre);
        }
        energy
    }

    fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for x in (0..self.count()).flat_map(|body| self.masses(body)) {
            hasher.write_u64(x.to_bits());
        }
        hasher.finish()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let BodyPlacement { centres, turn } = &snapshot.state.configuration;
        let mut numbers = centres.iter().flatten().chain(turn.coords.iter());
        let mut bodies = snapshot
            .active
            .iter()
            .flat_map(|a| a.contact.bodies)
            .flatten();
        centres.len() == self.count()
            && numbers.all(|x| x.is_finite())
            && bodies.all(|body| body < self.count())
    }
}

/// Bodies over the plane y = 0, stepped through time by one of the schemes that are compared.
#[derive(Debug)]
pub struct SphereSimulation {
    inner: Simulation<Bodies>,
    stepper: Stepper,
    grid: Pairs,
}

impl SphereSimulation {
    /// Spheres at rest with these centres, m.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        kind: SphereKind,
        centres: Vec<Vector3<f64>>,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let n = centres.len();
        let slab = None;
        Self::of(Bodies { kind, n, slab }, centres, options)
    }

    /// With a box among the spheres, upright and at rest with its centre (m) last.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn with_slab(
        kind: SphereKind,
        mut centres: Vec<Vector3<f64>>,
        (slab, centre): (Slab, Vector3<f64>),
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let n = centres.len();
        centres.push(centre);
        let slab = Some(slab);
        Self::of(Bodies { kind, n, slab }, centres, options)
    }

    fn of(
        bodies: Bodies,
        centres: Vec<Vector3<f64>>,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let turn = UnitQuaternion::identity();
        Ok(Self {
            stepper: Stepper::MoreauJean(options.variant),
            inner: Simulation::of(bodies, BodyPlacement { centres, turn }, options)?,
            grid: Pairs::default(),
        })
    }

    /// Stepped by another scheme than the options' variant.
    #[must_use]
    pub fn with_stepper(mut self, stepper: Stepper) -> Self {
        self.stepper = stepper;
        self
    }

    fn bodies(&self) -> &Bodies {
        self.inner.scene()
    }

    /// Centres of the spheres, and of the box last, m.
    #[must_use]
    pub fn centres(&self) -> &[Vector3<f64>] {
        &self.inner.q().centres
    }

    /// Attitude of the box.
    #[must_use]
    pub fn turn(&self) -> &UnitQuaternion<f64> {
        &self.inner.q().turn
    }

    /// Six velocities of each body, the box last, m/s and rad/s; the box's spin is in its own axes.
    #[must_use]
    pub fn v(&self) -> &[f64] {
        self.inner.v()
    }

    /// Starts anew where it is, with other velocities.
    pub fn start_with(&mut self, change: impl FnOnce(&mut [f64])) {
        let mut v = self.v().to_vec();
        change(&mut v);
        self.inner.place(self.inner.q().clone(), v);
    }

    /// Velocity of a body's centre, m/s.
    #[must_use]
    pub fn velocity(&self, body: usize) -> Vector3<f64> {
        linear(self.v(), body)
    }

    /// s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.inner.time()
    }

    /// The last step's operator W, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &BlockSparseDelassus {
        &self.inner.parts().W
    }

    /// Contacts of the last step.
    #[must_use]
    pub fn contacts(&self) -> &[ActiveContact<SphereContact>] {
        self.inner.contacts()
    }

    /// Takes `n` steps, or stops at the first that fails, keeping the state before it.
    ///
    /// # Errors
    /// See [`StepError`]. A solver that did not converge is no error: see the report.
    pub fn step(&mut self, n: usize) -> Result<StepReport, StepError> {
        self.inner.step_with(&self.stepper, n)
    }

    /// Kinetic and potential energy now, J.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.inner.energy().total()
    }

    /// Linear momentum, N s.
    #[must_use]
    pub fn momentum(&self) -> Vector3<f64> {
        let of_body = |body| linear(self.v(), body) * self.bodies().masses(body)[0];
        (0..self.bodies().count()).map(of_body).sum()
    }

    /// Angular momentum about the origin, N m s.
    #[must_use]
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let of_body = |body: usize| {
            let [m, _, _, x, y, z] = self.bodies().masses(body);
            let own = spin(self.v(), body).component_mul(&Vector3::new(x, y, z));
            let own = if body < self.bodies().n {
                own
            } else {
                self.turn() * own
            };
            self.centres()[body].cross(&(linear(self.v(), body) * m)) + own
        };
        (0..self.bodies().count()).map(of_body).sum()
    }

    /// Every overlap now, of bodies that were contacts or not.
    pub fn penetration(&mut self) -> Penetration {
        let mut found = Penetration::default();
        let mut enter = |depth: f64| {
            if depth > 0.0 {
                found.sum_of_squares += depth * depth;
                found.deepest = found.deepest.max(depth);
            }
        };
        let bodies = self.inner.scene();
        let (n, radius) = (bodies.n, bodies.kind.radius);
        let BodyPlacement { centres, turn } = self.inner.q();
        for x in &centres[..n] {
            enter(radius - x.y);
        }
        if let Some(slab) = &bodies.slab {
            for x in &centres[..n] {
                let own = turn.inverse_transform_vector(&(x - centres[n]));
                enter(radius - slab.nearest(&own).1);
            }
            for k in 0..CORNERS {
                enter(-(centres[n].y + (turn * slab.corner(k)).y));
            }
        }
        self.grid.visit(&centres[..n], 2.0 * radius, |i, j| {
            enter(-apart(&centres[i], &centres[j], radius).0);
        });
        found
    }
}
