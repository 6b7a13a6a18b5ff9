//! Bias `N(q, v) v + G(q)` by recursive Newton–Euler: the generalized force at zero acceleration.
//!
//! Source: Luh, Walker and Paul 1980; here in world axes about each tree's origin of places.

use nalgebra::{Matrix3, Vector3};

use super::joint::Joint;
use super::kinematics::{JointRate, Kinematics, joint_rate};
use super::model::{Body, Model};

/// Scratch of [`bias`], allocated once for a model.
#[derive(Clone, Debug)]
pub struct BiasScratch {
    bodies: Vec<Moved>,
}

/// A body at zero joint accelerations.
#[derive(Clone, Copy, Debug, Default)]
struct Moved {
    omega: Vector3<f64>,
    alpha: Vector3<f64>,
    /// Acceleration of its frame's origin, m/s².
    origin: Vector3<f64>,
    /// Force (N) and moment about the tree's origin (N m) on it and everything it carries.
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

impl Moved {
    /// Acceleration of a point fixed to it at `d` from its frame's origin.
    #[inline]
    fn accelerates(&self, d: &Vector3<f64>) -> Vector3<f64> {
        self.origin + self.alpha.cross(d) + self.omega.cross(&self.omega.cross(d))
    }
}

/// Angular velocity, angular acceleration and acceleration of the origin of a body that no revolute
/// joint ties to another one.
#[cold]
fn otherwise_carried(
    body: &Body,
    kinematics: &Kinematics,
    moved: &[Moved],
    b: usize,
    v: &[f64],
) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let (carrier, d) = match body.parent {
        Some(parent) => (moved[parent], kinematics.r[b] - kinematics.r[parent]),
        None => (Moved::default(), Vector3::zeros()),
    };
    let JointRate { spin, slide } = joint_rate(body, kinematics, v);
    (
        carrier.omega + spin,
        carrier.alpha + carrier.omega.cross(&spin),
        carrier.accelerates(&d) + carrier.omega.cross(&slide) * 2.0,
    )
}

/// A body with this angular velocity, angular acceleration and acceleration of the origin, and the
/// force and moment on it alone.
#[inline]
fn loaded(
    body: &Body,
    kinematics: &Kinematics,
    b: usize,
    gravity: &Vector3<f64>,
    (omega, alpha, origin): (Vector3<f64>, Vector3<f64>, Vector3<f64>),
) -> Moved {
    let c = &kinematics.c[b];
    let acceleration = if body.is_centred() {
        origin
    } else {
        let lever = c - kinematics.r[b];
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
    Moved {
        omega,
        alpha,
        origin,
        force,
        moment: moment + c.cross(&force),
    }
}

/// Bias `b` in `M v̇ + b = τ`: Coriolis, centrifugal, gyroscopic and gravity terms.
///
/// `v`, `out`: (nv), N along a velocity in m/s, N m about one in rad/s. `gravity`: m/s², world.
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
        let (omega, alpha, origin) = match body.parent {
            None if matches!(body.joint, Joint::Free(_)) => {
                let k = body.velocity + 3;
                let omega = Vector3::new(v[k], v[k + 1], v[k + 2]);
                (omega, Vector3::zeros(), Vector3::zeros())
            }
            Some(parent) if matches!(body.joint, Joint::Revolute(_)) => {
                let carrier = &moved[parent];
                let d = r - kinematics.r[parent];
                let spin = kinematics.motions[body.motion].axis() * v[body.velocity];
                (
                    carrier.omega + spin,
                    carrier.alpha + carrier.omega.cross(&spin),
                    carrier.accelerates(&d),
                )
            }
            _ => otherwise_carried(body, kinematics, moved, b, v),
        };
        moved[b] = loaded(body, kinematics, b, gravity, (omega, alpha, origin));
    }
    out.fill(0.0);
    for b in (0..bodies.len()).rev() {
        let body = &bodies[b];
        let Moved { force, moment, .. } = moved[b];
        let k = body.velocity;
        if matches!(body.joint, Joint::Free(_)) {
            out[k..k + 3].copy_from_slice(force.as_slice());
            out[k + 3..k + 6].copy_from_slice(moment.as_slice());
            continue;
        }
        // A coupled joint adds to the joint that it follows.
        for (i, m) in body.motions().enumerate() {
            out[k + i] += kinematics.motions[m].power(&force, &moment);
        }
        if let Some(parent) = body.parent {
            let carrier = &mut moved[parent];
            carrier.force += force;
            carrier.moment += moment;
        }
    }
}
