//! Dynamics of a machine as a sum over its rigid bodies, without recursion over the tree but for
//! places and velocities: an independent reference.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use rover_core::multibody::joint::SingleJoint;
use rover_core::multibody::{Body, Configuration, Joint, Model};

/// A body in world axes and in a state.
#[derive(Clone, Copy, Debug)]
pub struct Moving {
    pub R: Matrix3<f64>,
    /// Origin of its frame and mass centre, world, m.
    pub r: Vector3<f64>,
    pub c: Vector3<f64>,
    pub omega: Vector3<f64>,
    /// Of its origin and of its mass centre, m/s.
    pub r_dot: Vector3<f64>,
    pub c_dot: Vector3<f64>,
}

/// All bodies of a model in the state (q, v).
pub fn moving(model: &Model, q: &Configuration, v: &[f64]) -> Vec<Moving> {
    let mut all: Vec<Moving> = Vec::new();
    for body in model.bodies() {
        let zero = Vector3::zeros();
        let carrier = body.parent.map_or(
            Moving {
                R: Matrix3::identity(),
                r: zero,
                c: zero,
                omega: zero,
                r_dot: zero,
                c_dot: zero,
            },
            |parent| all[parent],
        );
        let frame = carrier.R * body.rotation.unwrap_or_else(Matrix3::identity);
        let mut r = carrier.r + carrier.R * body.position;
        let (mut turn, mut spin, mut slide) = (Matrix3::identity(), zero, zero);
        let k = body.velocity;
        // Of a joint that follows another: its rate and coordinate per unit of the other's.
        let (ratio, offset) = (body.joint.coupling()).map_or((1.0, 0.0), |c| (c.ratio, c.offset));
        let coordinate = |joint: usize| ratio * q.joints[joint] + offset;
        let single = match &body.joint {
            Joint::Free(free) => {
                let pose = q.pose(*free);
                r = pose.position;
                turn = rotation(&pose.attitude);
                slide = Vector3::new(v[k], v[k + 1], v[k + 2]);
                spin = Vector3::new(v[k + 3], v[k + 4], v[k + 5]);
                None
            }
            Joint::Fixed(_) => None,
            Joint::Spherical(joint) => {
                turn = rotation(&q.rotations[joint.rotation]);
                spin = frame * Vector3::new(v[k], v[k + 1], v[k + 2]);
                None
            }
            Joint::Revolute(joint) => Some(SingleJoint::Revolute(*joint)),
            Joint::Prismatic(joint) => Some(SingleJoint::Prismatic(*joint)),
            Joint::Coupled(joint) => Some(joint.moves),
        };
        match single {
            Some(SingleJoint::Revolute(joint)) => {
                let axis = joint.axis.direction();
                // A spinner is not turned about its own axis.
                let angle = if body.is_spinner {
                    0.0
                } else {
                    coordinate(joint.coordinate)
                };
                turn = *Rotation3::new(axis * angle).matrix();
                spin = frame * axis * ratio * v[k];
            }
            Some(SingleJoint::Prismatic(joint)) => {
                let axis = frame * joint.axis.direction();
                r += axis * coordinate(joint.coordinate);
                slide = axis * (ratio * v[k]);
            }
            None => {}
        }
        // A free root's frame is turned from the world's.
        let R = if matches!(body.joint, Joint::Free(_)) {
            turn
        } else {
            frame * turn
        };
        let omega = carrier.omega + spin;
        let r_dot = carrier.r_dot + carrier.omega.cross(&(r - carrier.r)) + slide;
        let lever = R * body.centre_of_mass;
        all.push(Moving {
            R,
            r,
            c: r + lever,
            omega,
            r_dot,
            c_dot: r_dot + omega.cross(&lever),
        });
    }
    all
}

fn rotation(q: &UnitQuaternion<f64>) -> Matrix3<f64> {
    *q.to_rotation_matrix().matrix()
}

/// Inertia about the mass centre, world axes.
fn inertia(body: &Body, own: &Moving) -> Matrix3<f64> {
    let A = own.R * body.principal_axes.unwrap_or_else(Matrix3::identity);
    A * Matrix3::from_diagonal(&body.principal_inertia) * A.transpose()
}

/// The bodies' velocities at a unit of each velocity.
pub fn units(model: &Model, q: &Configuration) -> Vec<Vec<Moving>> {
    let unit = |k: usize| {
        let mut e = vec![0.0; model.nv()];
        e[k] = 1.0;
        moving(model, q, &e)
    };
    (0..model.nv()).map(unit).collect()
}

/// `Σ m Jᵀ J + J_ωᵀ I J_ω`, and the rotors.
pub fn mass_matrix(model: &Model, units: &[Vec<Moving>]) -> DMatrix<f64> {
    let nv = model.nv();
    let mut M = DMatrix::zeros(nv, nv);
    for (b, body) in model.bodies().iter().enumerate() {
        for j in 0..nv {
            let own = &units[j][b];
            let (p, l) = (own.c_dot * body.mass, inertia(body, own) * own.omega);
            for k in 0..nv {
                let other = &units[k][b];
                M[(k, j)] += other.c_dot.dot(&p) + other.omega.dot(&l);
            }
        }
    }
    for &(k, rotor) in model.armatures() {
        M[(k, k)] += rotor;
    }
    M
}

/// Sums over the bodies, and over the magnitudes of the terms where these may cancel.
#[derive(Default)]
pub struct Energy {
    /// J.
    pub kinetic: f64,
    /// J.
    pub potential: (f64, f64),
    /// kg m/s.
    pub momentum: (Vector3<f64>, f64),
}

pub fn energy(model: &Model, bodies: &[Moving], v: &[f64], gravity: &Vector3<f64>) -> Energy {
    let mut sum = Energy::default();
    for (body, own) in model.bodies().iter().zip(bodies) {
        let turning = own.omega.dot(&(inertia(body, own) * own.omega));
        sum.kinetic += 0.5 * (body.mass * own.c_dot.norm_squared() + turning);
        sum.potential.0 -= body.mass * gravity.dot(&own.c);
        sum.potential.1 += body.mass * gravity.norm() * own.c.norm();
        sum.momentum.0 += own.c_dot * body.mass;
        sum.momentum.1 += own.c_dot.norm() * body.mass;
    }
    for &(k, rotor) in model.armatures() {
        sum.kinetic += 0.5 * rotor * v[k] * v[k];
    }
    sum
}

/// `Σ Jᵀ (ṗ − m g) + J_ωᵀ L̇` along the motion with the constant velocity v, by differences of
/// fourth order of the bodies' momenta.
pub fn bias(
    model: &Model,
    q: &Configuration,
    v: &[f64],
    gravity: &Vector3<f64>,
    units: &[Vec<Moving>],
) -> DVector<f64> {
    let h = 1e-3 / v.iter().map(|v| v.abs()).fold(1.0, f64::max);
    let momenta = |steps: f64| {
        let mut at = q.clone();
        at.advance(model, v, steps * h);
        let bodies = moving(model, &at, v);
        let own = model.bodies().iter().zip(bodies);
        own.map(|(body, own)| [own.c_dot * body.mass, inertia(body, &own) * own.omega])
            .collect::<Vec<_>>()
    };
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(momenta);
    let rate = |i: usize, k: usize| ((c[i][k] - b[i][k]) * 8.0 - (d[i][k] - a[i][k])) / (12.0 * h);
    let mut bias = DVector::zeros(model.nv());
    for (i, body) in model.bodies().iter().enumerate() {
        let force = rate(i, 0) - gravity * body.mass;
        let moment = rate(i, 1);
        for (k, unit) in units.iter().enumerate() {
            bias[k] += unit[i].c_dot.dot(&force) + unit[i].omega.dot(&moment);
        }
    }
    bias
}

/// `D^(-1/2) L^(-T) y` with the factor `M = Lᵀ D L`: Cholesky's of M in reverse order.
pub fn half_solve(M: &DMatrix<f64>, y: &[f64]) -> Vec<f64> {
    let n = M.nrows();
    let reversed = DMatrix::from_fn(n, n, |i, j| M[(n - 1 - i, n - 1 - j)]);
    let L = reversed.cholesky().unwrap().l();
    let y = DVector::from_fn(n, |i, _| y[n - 1 - i]);
    let x = L.solve_lower_triangular(&y).unwrap();
    x.iter().rev().copied().collect()
}
