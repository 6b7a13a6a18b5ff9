//! Beds of grains that the tests share.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use rover_core::integrator::StepOptions;
use rover_core::problem::BodyPairs;
use rover_core::simulation::{GrainSimulation, grain_options};
use rover_core::solver::Swept;
use rover_core::system::grains::{GrainFriction, GrainScene, Grains, Wall};

pub const G: f64 = 9.81;

/// Radius of grains that are alike, m, and their mass, kg.
pub const RADIUS: f64 = 0.1;
pub const MASS: f64 = 2.0;

/// So many grains of [`RADIUS`] and [`MASS`].
pub fn alike<const D: usize>(n: usize) -> Grains<D> {
    Grains::new(vec![RADIUS; n], vec![MASS; n]).unwrap()
}

/// μ of all contacts.
pub fn rough(mu: f64) -> GrainFriction {
    GrainFriction {
        grains: mu,
        walls: mu,
        wheels: mu,
        ..GrainFriction::default()
    }
}

/// Grains and walls, without any other ground and without a machine.
pub fn between<const D: usize>(
    walls: Vec<Wall<D>>,
    grains: Grains<D>,
    friction: GrainFriction,
) -> GrainScene<D> {
    GrainScene {
        grains,
        walls,
        ground: None,
        machine: None,
        friction,
    }
}

/// Options of a scene whose steps are solved to this tolerance, relative and in m/s.
pub fn exact<const D: usize>(scene: &GrainScene<D>, tolerance: f64) -> StepOptions {
    let mut options = grain_options(&scene.grains);
    solve_to(&mut options, tolerance, tolerance, 20_000);
    options
}

/// Sets the tolerances of the solver, relative and in m/s, and its largest number of sweeps.
pub fn solve_to(options: &mut StepOptions, relative: f64, velocity: f64, sweeps: usize) {
    options.solver.tolerance = relative;
    options.solver.velocity_tolerance = velocity;
    options.solver.max_sweeps = sweeps;
}

/// A bed at rest whose grains never sleep.
pub fn awake<const D: usize>(
    scene: GrainScene<D>,
    options: StepOptions,
    q: &[f64],
) -> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    GrainSimulation::new(Arc::new(scene), options, None, q.to_vec()).unwrap()
}
