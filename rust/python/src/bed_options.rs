//! Options of beds of grains, declared once: `disk_options!` and `ball_options!` list them.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::grain_options;
use rover_core::system::grains::{GrainFriction, GrainScene, Grains, SleepOptions};

use crate::arguments::Named;
use crate::arrays::triple;
use crate::errors::Result;
use crate::options::{self, GrainStabilisation, OptionRow, Options};
use crate::planar::pair;

/// Options of a bed in D dimensions as its arguments give them, but for gravity.
#[derive(Default)]
pub struct BedOptions<const D: usize> {
    pub friction: GrainFriction,
    pub cohesion: f64,
    pub cohesion_range: Option<f64>,
    stabilisation: Option<GrainStabilisation>,
    sleeps: bool,
    rest: SleepOptions,
    pub step: StepOptions,
}

/// Options of all beds, followed by those of a class; see [`options::step_options`].
macro_rules! any_bed_options {
    ($then:ident $($own:tt)*) => { $crate::options::$then! {
        /// Coulomb's coefficient between grains.
        friction => friction.grains;
        /// Coulomb's coefficient of grains on walls and on the ground, vessel or terrain.
        wall_friction => friction.walls;
        /// Coefficient of rolling friction of grains: the largest resisting moment divided by
        /// the normal force and the rolling radius r. Between two grains 1/r = 1/r_1 + 1/r_2; on
        /// anything else r is the grain's radius. A grain stays at rest on a slope whose tangent is
        /// at most this coefficient. It does not act on wheels, nor if Coulomb's coefficient is 0.
        rolling_friction => friction.rolling.rolling;
        /// Newton's coefficient of all contacts, in [0, 1].
        restitution => step.restitution;
        /// Time step, s.
        time_step => step.time_step;
        /// Largest relative residual of the contact problem. Errors of velocities are also
        /// limited: those of disks to ten times this value in m/s, times the square root of
        /// gravity / 9.81 m/s²; those of balls to 25 times this value, times the square root of
        /// gravity times the smallest radius. Without gravity 9.81 m/s² is used.
        tolerance => step.solver.tolerance;
        /// Largest number of sweeps of the contact solver in a step.
        max_iterations => step.solver.max_sweeps;
        /// Treatment of overlaps: "projection" moves overlapping bodies apart, "push_out"
        /// removes a fifth of the excessive overlap in each step, "none" leaves it. The first two
        /// may add energy by lifting the bodies above. The default is "projection" with restitution
        /// or in a vessel, whose curved walls cause an overlap in every step; otherwise "push_out"
        /// for balls and "none" for disks.
        stabilisation | None => stabilisation;
        /// Overlap that stabilisation does not correct, m; 0.5% of the smallest radius by
        /// default.
        penetration_tolerance | None => step.penetration_tolerance;
        /// Whether to skip grains that are at rest and far from moving bodies.
        sleep | untold => sleeps;
        /// Speed below which a grain is at rest, m/s; 5e-4 by default.
        sleep_speed | None | untold => rest.speed;
        /// A grain sleeps if no body within this distance moves, m; 0.2 by default.
        sleep_distance | None | untold => rest.distance;
        $($own)*
    } };
}
pub(crate) use any_bed_options;

/// Options of beds of disks.
macro_rules! disk_options {
    ($then:ident) => {
        $crate::bed_options::any_bed_options! { $then
            /// Coulomb's coefficient of wheels.
            wheel_friction => friction.wheels;
        }
    };
}
pub(crate) use disk_options;

/// Options of beds of balls.
macro_rules! ball_options {
    ($then:ident) => {
        $crate::bed_options::any_bed_options! { $then
            /// Coefficient of friction against rotation about the contact normal, as
            /// `rolling_friction`.
            drilling_friction => friction.rolling.drilling;
            /// Attractive force between bodies in contact, N: the pull that separates them.
            /// The contact law is 0 <= u_N + gap/h, p_N + h cohesion >= 0, one of them 0; the
            /// tangential impulse is at most friction (p_N + h cohesion).
            cohesion => cohesion;
            /// Gap up to which the attraction acts, m; 1% of the smallest radius by default, at
            /// most 20%.
            cohesion_range | None => cohesion_range;
            /// Number of threads that solve the contact problem. The result does not depend on it.
            /// With fewer than some thousands of balls, a second thread gains little.
            threads | untold => step.solver.threads;
        }
    };
}
pub(crate) use ball_options;

/// Gravity of the Earth, m/s².
const EARTH: f64 = 9.81;

impl<const D: usize> Options for BedOptions<D> {
    const TABLE: &'static [OptionRow<Self>] = if D == 2 {
        disk_options!(rows)
    } else {
        ball_options!(rows)
    };

    fn usual() -> Self {
        let mut own = Self::default();
        let step = &mut own.step;
        (step.time_step, step.solver.tolerance) = match D {
            2 => (1e-3, 1e-4),
            _ => (2e-3, 1e-3),
        };
        step.solver.max_sweeps = 2000;
        own
    }
}

impl<const D: usize> BedOptions<D> {
    /// Reads the options of these grains by their names. `is_hollow`: whether what slides along a
    /// surface goes into it, as along the inside of a curve.
    ///
    /// Velocities of balls are right to 25 times the tolerance, in units of the speed that the
    /// smallest one gains over its radius, √(g r): the same bed at another scale or under another
    /// gravity is solved alike. Velocities of disks are right to ten times the tolerance in m/s
    /// under the gravity of the Earth.
    pub fn read(given: &Named<'_>, grains: &Grains<D>, is_hollow: bool) -> Result<Self> {
        let mut own = Self::usual();
        let (time_step, solver) = (own.step.time_step, own.step.solver);
        own.step = StepOptions {
            time_step,
            solver,
            ..grain_options(grains)
        };
        let usual = own.step.gravity.norm();
        options::read(&mut own, given)?;
        own.rest.check()?;
        let step = &mut own.step;
        let gravity = given.read("gravity", |value, kind, field| match D {
            2 => Ok(pair(value, kind, field)?.push(0.0)),
            _ => triple(value, kind, field).map(Vector3::from),
        })?;
        step.gravity = gravity.unwrap_or(step.gravity);
        step.stabilisation = match own.stabilisation {
            Some(GrainStabilisation(given)) => given,
            // What is struck away meets others that were not forecast, and goes into them.
            None if step.restitution > 0.0 || is_hollow => Stabilisation::Projection,
            // Under a machine balls sink into the ground by what the solver's tolerance allows.
            None if D == 3 => Stabilisation::PushOut,
            None => Stabilisation::None,
        };
        let speed = if D == 2 {
            10.0
        } else {
            25.0 * (EARTH * grains.smallest()).sqrt()
        };
        let weight = step.gravity.norm();
        let scale = if weight > 0.0 {
            (weight / usual).sqrt()
        } else {
            1.0
        };
        step.solver.velocity_tolerance = speed * step.solver.tolerance * scale;
        Ok(own)
    }

    /// When the grains sleep; None where they never do.
    pub fn sleep(&self) -> Option<SleepOptions> {
        self.sleeps.then_some(self.rest)
    }
}

/// The options of contacts, gravity and solver by the names of the arguments.
pub fn settings<'py, const D: usize>(
    py: Python<'py>,
    step: &StepOptions,
    scene: &GrainScene<D>,
) -> Result<Bound<'py, PyDict>> {
    let gravity = PyTuple::new(py, &step.gravity.as_slice()[..D])?;
    let cohesion = scene.grains.cohesion();
    let known = BedOptions::<D> {
        friction: scene.friction,
        cohesion: cohesion.map_or(0.0, |own| own.force),
        cohesion_range: cohesion.map(|own| own.range),
        stabilisation: Some(GrainStabilisation(step.stabilisation)),
        step: step.clone(),
        ..BedOptions::default()
    };
    options::settings(&gravity, known)
}
