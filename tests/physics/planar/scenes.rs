//! Scenes and helpers of the planar tests.

use std::sync::Arc;

use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use rover_core::integrator::{Stabilisation, StepOptions, Variant};
use rover_core::planar::{ContactRule, Line, PlanarGround, PlanarTree};
use rover_core::simulation::PlanarSimulation;

pub use crate::shared::VARIANTS;

pub const G: f64 = 9.81;

/// Options with gravity straight down.
pub fn options(g: f64, friction: f64, restitution: f64, time_step: f64) -> StepOptions {
    StepOptions {
        gravity: Vector3::new(0.0, -g, 0.0),
        friction_coefficient: friction,
        restitution,
        time_step,
        ..StepOptions::default()
    }
}

/// Options of a variant with gravity straight down.
pub fn options_of(variant: Variant, g: f64, friction: f64, e: f64, time_step: f64) -> StepOptions {
    StepOptions {
        variant,
        ..options(g, friction, e, time_step)
    }
}

/// The reference runs' own settings: no projection.
pub fn unprojected(options: &StepOptions) -> StepOptions {
    StepOptions {
        stabilisation: Stabilisation::None,
        ..options.clone()
    }
}

/// A machine on a ground with true contact, in a state.
pub fn placed<const N: usize>(
    ground: impl PlanarGround + 'static,
    machine: impl Into<PlanarTree>,
    options: StepOptions,
    q: [f64; N],
    v: [f64; N],
) -> PlanarSimulation {
    let rule = ContactRule::Nearest;
    let ground = Arc::new(ground);
    let mut simulation = PlanarSimulation::new(machine, ground, rule, options).unwrap();
    simulation.set_state(&q, &v).unwrap();
    simulation
}

/// A machine at rest on a ground with true contact.
pub fn at_rest<const N: usize>(
    ground: impl PlanarGround + 'static,
    machine: impl Into<PlanarTree>,
    options: StepOptions,
    q: [f64; N],
) -> PlanarSimulation {
    placed(ground, machine, options, q, [0.0; N])
}

/// A line through the origin that rises by an angle, rad.
pub fn incline(angle: f64) -> Line {
    Line::new(angle.tan(), 0.0).unwrap()
}

/// Level ground at height 0.
pub fn level() -> Line {
    Line::new(0.0, 0.0).unwrap()
}

/// Number of steps in a time.
pub fn count(duration: f64, time_step: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let n = (duration / time_step).round() as usize;
    n
}

/// Length of a velocity.
pub fn speed(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// `M(q)` of a machine.
pub fn mass_matrix<const NV: usize>(
    machine: &PlanarTree,
    q: &SVector<f64, NV>,
) -> SMatrix<f64, NV, NV> {
    let mut M = vec![0.0; NV * NV];
    machine.mass_matrix(&machine.poses(q.as_slice()), &mut M);
    SMatrix::from_row_slice(&M)
}

/// `F(q, v)` of a machine.
pub fn force<const NV: usize>(
    machine: &PlanarTree,
    q: &SVector<f64, NV>,
    v: &SVector<f64, NV>,
    gravity: &Vector2<f64>,
    torques: &[f64],
) -> SVector<f64, NV> {
    let mut F = SVector::<f64, NV>::zeros();
    let mut poses = machine.poses(q.as_slice());
    machine.force(&mut poses, v.as_slice(), gravity, torques, F.as_mut_slice());
    F
}
