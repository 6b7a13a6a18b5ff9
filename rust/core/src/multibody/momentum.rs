//! Momentum of a state, body by body and summed, and the mass centre.

use nalgebra::Vector3;

use super::joint::{Joint, Motion, free};
use super::kinematics::Kinematics;
use super::model::Model;
use super::poses::Poses;

/// Linear (kg m/s) and angular momentum (kg m²/s, about a point chosen by the caller).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// World axes.
    pub linear: Vector3<f64>,
    /// World axes.
    pub angular: Vector3<f64>,
}

/// Momentum of each body about a point of its tree.
///
/// `about`: the origin of each tree's places relative to that point, m. `out`: one entry a body.
pub fn body_momenta(
    model: &Model,
    poses: &Poses<f64>,
    v: &[f64],
    about: impl Fn(usize) -> Vector3<f64>,
    out: &mut [Momentum],
) {
    // `out` holds each body's angular velocity and the velocity of its material point at the tree's
    // origin until overwritten.
    for (b, body) in model.bodies().iter().enumerate() {
        let mut own = body
            .parent
            .map_or(Momentum::default(), |parent| out[parent]);
        let v = &v[body.velocity..];
        if let Joint::Free(_) = body.joint {
            let Motion { axis, swing } = free::velocity(v);
            (own.linear, own.angular) = (swing.into(), axis.into());
        }
        for (motion, v) in poses.motions[body.motions()].iter().zip(v) {
            own.linear += Vector3::from(motion.swing) * *v;
            own.angular += Vector3::from(motion.axis) * *v;
        }
        out[b] = own;
    }
    for (t, tree) in model.trees().iter().enumerate() {
        let about = about(t);
        for b in tree.bodies.clone() {
            let (body, pose) = (&model.bodies()[b], &poses.bodies[b]);
            let c = Vector3::from(pose.c);
            let omega = out[b].angular;
            let p = (out[b].linear + omega.cross(&c)) * body.mass;
            let A = body.principal_attitude(pose.R.into());
            let spin = body.principal_inertia.component_mul(&A.tr_mul(&omega));
            out[b] = Momentum {
                linear: p,
                angular: A * spin + (c + about).cross(&p),
            };
        }
    }
}

/// Mass centre, world, m.
#[must_use]
pub fn centre_of_mass(model: &Model, kinematics: &Kinematics) -> Vector3<f64> {
    let mut moment: Vector3<f64> = (model.bodies().iter().enumerate())
        .map(|(b, body)| kinematics.c(b) * body.mass)
        .sum();
    for tree in &model.trees()[1..] {
        let from_first = kinematics.origin(tree.bodies.start) - kinematics.origin(0);
        moment += from_first * tree.mass;
    }
    kinematics.origin(0) + moment / model.mass()
}

/// Total momentum, angular about the world's origin.
#[must_use]
pub fn momentum(model: &Model, kinematics: &Kinematics, v: &[f64]) -> Momentum {
    let mut momenta = vec![Momentum::default(); model.bodies().len()];
    let about = |tree: usize| *kinematics.origin(model.trees()[tree].bodies.start);
    body_momenta(model, kinematics.poses(), v, about, &mut momenta);
    Momentum {
        linear: momenta.iter().map(|m| m.linear).sum(),
        angular: momenta.iter().map(|m| m.angular).sum(),
    }
}
