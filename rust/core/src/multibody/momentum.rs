//! Energy and momentum of a state, summed over the bodies.

use nalgebra::Vector3;

use super::kinematics::Kinematics;
use super::model::Model;

/// Kinetic and potential energy, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// `½ vᵀ M v`.
    pub kinetic: f64,
    /// `−Σ m g · x`, zero with all mass centres at the world's origin.
    pub potential: f64,
}

impl Energy {
    /// Sum of both.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}

/// Linear (kg m/s) and angular momentum (kg m²/s, about a point that the caller named).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// World axes.
    pub linear: Vector3<f64>,
    /// World axes.
    pub angular: Vector3<f64>,
}

/// Momentum of each body about the trunk origin shifted by `−about`, that is about the point
/// `base − about`; also returns the kinetic energy (J).
///
/// `out`: one entry a body.
pub fn body_momenta(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    about: &Vector3<f64>,
    out: &mut [Momentum],
) -> f64 {
    let mut kinetic = 0.0;
    // Velocity of each frame's origin and angular velocity ride along the tree in `out` until overwritten.
    for (b, body) in model.bodies().iter().enumerate() {
        let (origin, omega) = if b == 0 {
            (
                Vector3::new(v[0], v[1], v[2]),
                Vector3::new(v[3], v[4], v[5]),
            )
        } else {
            let p = &out[body.parent];
            let d = kinematics.r[b] - kinematics.r[body.parent];
            (
                p.linear + p.angular.cross(&d),
                p.angular + kinematics.axis[b] * v[5 + b],
            )
        };
        out[b] = Momentum {
            linear: origin,
            angular: omega,
        };
    }
    for (b, body) in model.bodies().iter().enumerate() {
        let Momentum {
            linear: origin,
            angular: omega,
        } = out[b];
        let velocity = origin + omega.cross(&(kinematics.c[b] - kinematics.r[b]));
        let A = match &body.principal_axes {
            None => kinematics.R[b],
            Some(P) => kinematics.R[b] * P,
        };
        let w = A.tr_mul(&omega);
        let spin = body.principal_inertia.component_mul(&w);
        let p = velocity * body.mass;
        kinetic += 0.5 * (p.dot(&velocity) + spin.dot(&w));
        out[b] = Momentum {
            linear: p,
            angular: A * spin + (kinematics.c[b] + about).cross(&p),
        };
    }
    kinetic
}

/// Mass centre, world, m.
#[must_use]
pub fn centre_of_mass(model: &Model, kinematics: &Kinematics) -> Vector3<f64> {
    let moment: Vector3<f64> = model
        .bodies()
        .iter()
        .zip(&kinematics.c)
        .map(|(body, c)| c * body.mass)
        .sum();
    kinematics.base + moment / model.mass()
}

/// Energy of a state.
#[must_use]
pub fn energy(model: &Model, kinematics: &Kinematics, v: &[f64], gravity: &Vector3<f64>) -> Energy {
    let mut momenta = vec![Momentum::default(); model.bodies().len()];
    let kinetic = body_momenta(model, kinematics, v, &Vector3::zeros(), &mut momenta);
    Energy {
        kinetic,
        potential: -model.mass() * gravity.dot(&centre_of_mass(model, kinematics)),
    }
}

/// Total momentum, angular about the world's origin.
#[must_use]
pub fn momentum(model: &Model, kinematics: &Kinematics, v: &[f64]) -> Momentum {
    let mut momenta = vec![Momentum::default(); model.bodies().len()];
    body_momenta(model, kinematics, v, &kinematics.base, &mut momenta);
    Momentum {
        linear: momenta.iter().map(|m| m.linear).sum(),
        angular: momenta.iter().map(|m| m.angular).sum(),
    }
}
