//! Energy and momentum of a state, summed over the bodies.

use nalgebra::{Matrix3, Vector3};

use super::joint::{Joint, Prismatic, Revolute, Spherical};
use super::kinematics::{JointRate, Kinematics, joint_rate};
use super::model::{Body, Model};
use super::state::Configuration;

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

/// Linear (kg m/s) and angular momentum (kg m²/s, about a point chosen by the caller).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// World axes.
    pub linear: Vector3<f64>,
    /// World axes.
    pub angular: Vector3<f64>,
}

/// Momentum of each body about a point of its tree, and the kinetic energy of all, rotors included
/// (J).
///
/// `about`: the origin of each tree's places relative to that point, m. `out`: one entry a body.
pub fn body_momenta(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    about: impl Fn(usize) -> Vector3<f64>,
    out: &mut [Momentum],
) -> f64 {
    let mut kinetic = 0.0;
    // `out` holds each body's angular velocity and the velocity of its frame's origin until
    // overwritten.
    for (b, body) in model.bodies().iter().enumerate() {
        let (origin, omega) = match body.parent {
            None if matches!(body.joint, Joint::Free(_)) => {
                let v = &v[body.velocity..];
                (
                    Vector3::new(v[0], v[1], v[2]),
                    Vector3::new(v[3], v[4], v[5]),
                )
            }
            Some(parent) if matches!(body.joint, Joint::Revolute(_)) => {
                let p = &out[parent];
                let d = kinematics.r[b] - kinematics.r[parent];
                (
                    p.linear + p.angular.cross(&d),
                    p.angular + kinematics.motions[body.motion].axis() * v[body.velocity],
                )
            }
            parent => {
                let (p, d) = match parent {
                    Some(parent) => (out[parent], kinematics.r[b] - kinematics.r[parent]),
                    None => (Momentum::default(), Vector3::zeros()),
                };
                let JointRate { spin, slide } = joint_rate(body, kinematics, v);
                (p.linear + p.angular.cross(&d) + slide, p.angular + spin)
            }
        };
        out[b] = Momentum {
            linear: origin,
            angular: omega,
        };
    }
    for (t, tree) in model.trees().iter().enumerate() {
        let about = about(t);
        for b in tree.bodies.clone() {
            let body = &model.bodies()[b];
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
    }
    for &(k, inertia) in model.armatures() {
        kinetic += 0.5 * inertia * v[k] * v[k];
    }
    kinetic
}

/// Mass centre, world, m.
#[must_use]
pub fn centre_of_mass(model: &Model, kinematics: &Kinematics) -> Vector3<f64> {
    let mut moment: Vector3<f64> = (model.bodies().iter().zip(&kinematics.c))
        .map(|(body, c)| c * body.mass)
        .sum();
    for tree in &model.trees()[1..] {
        let from_first = kinematics.origin(tree.bodies.start) - kinematics.origin(0);
        moment += from_first * tree.mass;
    }
    kinematics.origin(0) + moment / model.mass()
}

/// Scratch of [`energy_and_momentum`], allocated once for a model.
#[derive(Clone, Debug)]
pub struct EnergyScratch {
    moving: Vec<Moving>,
}

impl EnergyScratch {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            moving: vec![Moving::default(); model.bodies().len()],
        }
    }
}

/// Pose and velocity of a body's frame, world axes, places relative to the tree's origin.
#[derive(Clone, Copy, Debug, Default)]
struct Moving {
    R: Matrix3<f64>,
    r: Vector3<f64>,
    velocity: Vector3<f64>,
    omega: Vector3<f64>,
}

/// Energy and linear momentum (kg m/s) of a state in one sweep, without poses for any other use;
/// every step is audited with it.
pub fn energy_and_momentum(
    model: &Model,
    q: &Configuration,
    v: &[f64],
    gravity: &Vector3<f64>,
    scratch: &mut EnergyScratch,
) -> (Energy, Vector3<f64>) {
    let bodies = model.bodies();
    let moving = &mut scratch.moving[..bodies.len()];
    let mut sums = Sums::default();
    let world = Moving {
        R: Matrix3::identity(),
        ..Moving::default()
    };
    let mut height = Vector3::zeros();
    for (b, body) in bodies.iter().enumerate() {
        let (before, own) = moving.split_at_mut(b);
        let own = &mut own[0];
        let carrier = || body.parent.map_or(&world, |parent| &before[parent]);
        match &body.joint {
            Joint::Free(free) => {
                let (pose, v) = (q.pose(*free), &v[body.velocity..]);
                *own = Moving {
                    R: *pose.attitude.to_rotation_matrix().matrix(),
                    r: Vector3::zeros(),
                    velocity: Vector3::new(v[0], v[1], v[2]),
                    omega: Vector3::new(v[3], v[4], v[5]),
                };
                height += pose.position * model.trees()[body.tree].mass;
            }
            Joint::Revolute(joint) => own.turn(carrier(), body, joint, q, v),
            _ => own.follow(carrier(), body, q, v),
        }
        sums.add(body, own);
    }
    for &(k, inertia) in model.armatures() {
        sums.twice_kinetic += inertia * v[k] * v[k];
    }
    let energy = Energy {
        kinetic: 0.5 * sums.twice_kinetic,
        potential: -gravity.dot(&(height + sums.moment)),
    };
    (energy, sums.momentum)
}

impl Moving {
    /// Adds a body under a revolute joint to its carrier.
    #[inline]
    fn turn(
        &mut self,
        carrier: &Self,
        body: &Body,
        joint: &Revolute,
        q: &Configuration,
        v: &[f64],
    ) {
        let lever = carrier.R * body.position;
        self.r = carrier.r + lever;
        self.velocity = carrier.velocity + carrier.omega.cross(&lever);
        let fixed = body.rotation.as_ref().map(|fixed| carrier.R * fixed);
        let frame = fixed.as_ref().unwrap_or(&carrier.R);
        let axis;
        (self.R, axis) = if body.is_spinner {
            (*frame, joint.axis.turned(frame))
        } else {
            joint.axis.rotate(frame, joint.coordinate.of(&q.joints))
        };
        self.omega = carrier.omega + axis * joint.coordinate.rate(v[body.velocity]);
    }

    /// Adds any other body to its carrier.
    #[cold]
    fn follow(&mut self, carrier: &Self, body: &Body, q: &Configuration, v: &[f64]) {
        let mut lever = carrier.R * body.position;
        let frame = body.rotation.map_or(carrier.R, |fixed| carrier.R * fixed);
        let k = body.velocity;
        self.R = frame;
        self.omega = carrier.omega;
        self.velocity = carrier.velocity;
        match &body.joint {
            Joint::Prismatic(Prismatic { axis, coordinate }) => {
                let axis = axis.turned(&frame);
                lever += axis * coordinate.of(&q.joints);
                self.velocity += axis * coordinate.rate(v[k]);
            }
            Joint::Spherical(Spherical { rotation }) => {
                self.R = frame * q.rotations[*rotation].to_rotation_matrix().matrix();
                self.omega += frame * Vector3::new(v[k], v[k + 1], v[k + 2]);
            }
            Joint::Free(_) | Joint::Fixed | Joint::Revolute(_) => {}
        }
        self.r = carrier.r + lever;
        self.velocity += carrier.omega.cross(&lever);
    }
}

/// Sums over the bodies so far: twice the kinetic energy, linear momentum, and first moment about
/// the trees' origins.
#[derive(Default)]
struct Sums {
    twice_kinetic: f64,
    momentum: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Sums {
    #[inline]
    fn add(&mut self, body: &Body, own: &Moving) {
        let (mut c, mut velocity) = (own.r, own.velocity);
        if !body.is_centred() {
            let lever = own.R * body.centre_of_mass;
            c += lever;
            velocity += own.omega.cross(&lever);
        }
        let mut w = own.R.tr_mul(&own.omega);
        if let Some(P) = &body.principal_axes {
            w = P.tr_mul(&w);
        }
        self.twice_kinetic +=
            body.mass * velocity.norm_squared() + body.principal_inertia.dot(&w.component_mul(&w));
        self.momentum += velocity * body.mass;
        self.moment += c * body.mass;
    }
}

/// Energy of a state.
#[must_use]
pub fn energy(model: &Model, kinematics: &Kinematics, v: &[f64], gravity: &Vector3<f64>) -> Energy {
    let mut momenta = vec![Momentum::default(); model.bodies().len()];
    let here = |_| Vector3::zeros();
    let kinetic = body_momenta(model, kinematics, v, here, &mut momenta);
    Energy {
        kinetic,
        potential: -model.mass() * gravity.dot(&centre_of_mass(model, kinematics)),
    }
}

/// Total momentum, angular about the world's origin.
#[must_use]
pub fn momentum(model: &Model, kinematics: &Kinematics, v: &[f64]) -> Momentum {
    let mut momenta = vec![Momentum::default(); model.bodies().len()];
    let about = |tree: usize| *kinematics.origin(model.trees()[tree].bodies.start);
    body_momenta(model, kinematics, v, about, &mut momenta);
    Momentum {
        linear: momenta.iter().map(|m| m.linear).sum(),
        angular: momenta.iter().map(|m| m.angular).sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sweep_gives_the_energy_and_momentum_of_the_poses() {
        let rover = Model::rover();
        let joints = [
            ("right_bogie".to_owned(), 0.3),
            ("wheel_FL".to_owned(), 0.7),
        ];
        let welded = rover.with_locked_joints(&joints).unwrap();
        for model in [rover, welded] {
            let mut q = Configuration::zero(&model);
            let v: Vec<f64> = (0..model.nv()).map(|k| (1.7 * k as f64).sin()).collect();
            q.advance(&model, &v, 0.8);
            let gravity = Vector3::new(0.3, -9.81, 1.0);
            let kinematics = Kinematics::of(&model, &q);
            let mut scratch = EnergyScratch::new(&model);
            let (found, linear) = energy_and_momentum(&model, &q, &v, &gravity, &mut scratch);
            let expected = energy(&model, &kinematics, &v, &gravity);
            assert!((found.kinetic - expected.kinetic).abs() < 1e-13 * expected.kinetic);
            assert!((found.potential - expected.potential).abs() < 1e-12 * expected.kinetic);
            let total = momentum(&model, &kinematics, &v).linear;
            assert!((linear - total).norm() < 1e-13 * total.norm());
        }
    }
}
