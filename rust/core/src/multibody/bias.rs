//! Bias `N(q, v) v + G(q)` by recursive Newton–Euler: what must be pushed to keep all accelerations zero.
//!
//! Source: Luh, Walker and Paul 1980; here in world axes about the trunk origin.

use nalgebra::{Matrix3, Vector3};

use super::kinematics::Kinematics;
use super::model::Model;

/// Scratch of [`bias`]: sized once for a model.
#[derive(Clone, Debug)]
pub struct BiasScratch {
    bodies: Vec<Moved>,
}

/// A body whose joints do not accelerate.
#[derive(Clone, Copy, Debug, Default)]
struct Moved {
    omega: Vector3<f64>,
    alpha: Vector3<f64>,
    /// Acceleration of its frame's origin, m/s².
    origin: Vector3<f64>,
    /// What it and all that it carries need, N and N m about the trunk origin.
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

impl BiasScratch {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            bodies: vec![Moved::default(); model.bodies().len()],
        }
    }
}

/// Bias `b` in `M v̇ + b = τ`: Coriolis, centrifugal, gyroscopic and gravity terms.
///
/// `v`, `out`: (nv), N for the first three, N m for the others. `gravity`: m/s², world.
pub fn bias(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    gravity: &Vector3<f64>,
    scratch: &mut BiasScratch,
    out: &mut [f64],
) {
    let bodies = model.bodies();
    let moved = &mut scratch.bodies[..bodies.len()];
    for (b, body) in bodies.iter().enumerate() {
        let r = &kinematics.r[b];
        let (omega, alpha, origin) = if b == 0 {
            let omega = Vector3::new(v[3], v[4], v[5]);
            (omega, Vector3::zeros(), Vector3::zeros())
        } else {
            let carrier = &moved[body.parent];
            let d = r - kinematics.r[body.parent];
            let spin = kinematics.motions[b - 1].axis * v[5 + b];
            (
                carrier.omega + spin,
                carrier.alpha + carrier.omega.cross(&spin),
                carrier.origin
                    + carrier.alpha.cross(&d)
                    + carrier.omega.cross(&carrier.omega.cross(&d)),
            )
        };
        let c = &kinematics.c[b];
        let acceleration = if body.is_centred() {
            origin
        } else {
            let lever = c - r;
            origin + alpha.cross(&lever) + omega.cross(&omega.cross(&lever))
        };
        let force = (acceleration - gravity) * body.mass;
        let R = &kinematics.R[b];
        let I = &body.principal_inertia;
        let gyroscopic = |A: &Matrix3<f64>| {
            let (w, a) = (A.tr_mul(&omega), A.tr_mul(&alpha));
            A * (I.component_mul(&a) + w.cross(&I.component_mul(&w)))
        };
        let moment = match &body.principal_axes {
            None => gyroscopic(R),
            Some(P) => gyroscopic(&(R * P)),
        };
        moved[b] = Moved {
            omega,
            alpha,
            origin,
            force,
            moment: moment + c.cross(&force),
        };
    }
    for b in (1..bodies.len()).rev() {
        let Moved { force, moment, .. } = moved[b];
        out[5 + b] = kinematics.motions[b - 1]
            .axis
            .dot(&(moment - kinematics.r[b].cross(&force)));
        let carrier = &mut moved[bodies[b].parent];
        carrier.force += force;
        carrier.moment += moment;
    }
    out[..3].copy_from_slice(moved[0].force.as_slice());
    out[3..6].copy_from_slice(moved[0].moment.as_slice());
}
