//! Free spheres, and perhaps a box among them, stepped through time.

use rover_core::integrator::{
    Integrator, NoProbe, OptionsError, Scratch, StateMut, StepError, StepOptions, StepReport,
    WarmStart,
};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::problem::BlockSparseDelassus;

use crate::Stepper;
use crate::cell_grid::CellGrid;
use crate::free_spheres::{
    Bodies, NV, Placement, SphereContact, SphereKind, SphereScratch, SphereSystem, apart, linear,
    spin,
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

/// Bodies over the plane y = 0, stepped through time.
#[derive(Debug)]
pub struct SphereSimulation {
    bodies: Bodies,
    options: StepOptions,
    stepper: Stepper,
    placement: Placement,
    v: Vec<f64>,
    time: f64,
    warm_start: WarmStart<(u32, u32)>,
    parts: SphereScratch,
    scratch: Scratch<Placement, SphereContact>,
    grid: CellGrid,
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
        options.check()?;
        let n = centres.len();
        let bodies = Bodies {
            kind,
            n,
            slab: None,
        };
        let placement = Placement {
            centres,
            turn: UnitQuaternion::identity(),
        };
        Ok(Self {
            stepper: Stepper::MoreauJean(options.variant),
            bodies,
            options,
            v: vec![0.0; NV * n],
            time: 0.0,
            warm_start: WarmStart::default(),
            parts: SphereScratch::default(),
            scratch: Scratch::new(&placement, NV * n, 4 * n, 3),
            grid: CellGrid::default(),
            placement,
        })
    }

    /// With a box among the spheres, upright and at rest with its centre (m) here.
    #[must_use]
    pub fn with_slab(mut self, slab: Slab, centre: Vector3<f64>) -> Self {
        self.bodies.slab = Some(slab);
        self.placement.centres.truncate(self.bodies.n);
        self.placement.centres.push(centre);
        self.v.resize(NV * self.bodies.count(), 0.0);
        self.warm_start.clear();
        self.parts = SphereScratch::default();
        self
    }

    /// Stepped by another scheme than the options' variant.
    #[must_use]
    pub fn with_stepper(mut self, stepper: Stepper) -> Self {
        self.stepper = stepper;
        self
    }

    /// Centres of the spheres, and of the box last, m.
    #[must_use]
    pub fn centres(&self) -> &[Vector3<f64>] {
        &self.placement.centres
    }

    /// Attitude of the box.
    #[must_use]
    pub fn turn(&self) -> &UnitQuaternion<f64> {
        &self.placement.turn
    }

    /// Six velocities of each body, the box last, m/s and rad/s; the box's spin is in its own axes.
    #[must_use]
    pub fn v(&self) -> &[f64] {
        &self.v
    }

    /// The same, to be set.
    pub fn v_mut(&mut self) -> &mut [f64] {
        self.warm_start.clear();
        &mut self.v
    }

    /// Velocity of a body's centre, m/s.
    #[must_use]
    pub fn velocity(&self, body: usize) -> Vector3<f64> {
        linear(&self.v, body)
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
                bodies: &self.bodies,
                parts: &mut self.parts,
            };
            let state = StateMut {
                configuration: &mut self.placement,
                v: &mut self.v,
                time: &mut self.time,
            };
            let report = self.stepper.step(
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
        let of_body = |body: usize| {
            let masses = self.bodies.masses(body);
            let v = &self.v[NV * body..NV * (body + 1)];
            let kinetic: f64 = (0..NV).map(|k| 0.5 * masses[k] * v[k] * v[k]).sum();
            kinetic - masses[0] * self.options.gravity.dot(&self.placement.centres[body])
        };
        (0..self.bodies.count()).map(of_body).sum()
    }

    /// Linear momentum, N s.
    #[must_use]
    pub fn momentum(&self) -> Vector3<f64> {
        let of_body = |body| linear(&self.v, body) * self.bodies.masses(body)[0];
        (0..self.bodies.count()).map(of_body).sum()
    }

    /// Angular momentum about the origin, N m s.
    #[must_use]
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let of_body = |body: usize| {
            let [m, _, _, x, y, z] = self.bodies.masses(body);
            let own = spin(&self.v, body).component_mul(&Vector3::new(x, y, z));
            let own = if body < self.bodies.n {
                own
            } else {
                self.placement.turn * own
            };
            self.placement.centres[body].cross(&(linear(&self.v, body) * m)) + own
        };
        (0..self.bodies.count()).map(of_body).sum()
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
        let (n, radius) = (self.bodies.n, self.bodies.kind.radius);
        let Placement { centres, turn } = &self.placement;
        for x in &centres[..n] {
            enter(radius - x.y);
        }
        if let Some(slab) = &self.bodies.slab {
            for x in &centres[..n] {
                let own = turn.inverse_transform_vector(&(x - centres[n]));
                enter(radius - slab.nearest(&own).1);
            }
            for k in 0..CORNERS {
                enter(-(centres[n].y + (turn * slab.corner(k)).y));
            }
        }
        self.grid.visit_pairs(&centres[..n], 2.0 * radius, |i, j| {
            enter(-apart(&centres[i], &centres[j], radius).0);
        });
        found
    }
}
