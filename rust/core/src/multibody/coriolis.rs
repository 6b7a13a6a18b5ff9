//! Coriolis matrix `C(q, v)` with `C v = N(q, v) v` and `C + Cᵀ = Ṁ`, used for implicit gyroscopic
//! terms.
//!
//! With the inertia I of a body, its spatial velocity V, and `B = ½ (V×* I + (I V)×̄* − I V×)`,
//!
//! ```text
//! C_jk = Σ S_jᵀ (I Ṡ_k + B S_k)      over the bodies that both j and k move
//! ```
//!
//! Spatial vectors are (angular, linear) at the origin of the tree's places, world axes. A velocity
//! that several joints share, as coupled ones do, has a screw of each; their products add. `B + Bᵀ
//! = İ` and `B V = V×* I V`, which gives both properties.
//!
//! With V = (ω, v), mass m, first moment m c and inertia J about that origin, and the momentum I V
//! = (n, f)
//!
//! ```text
//! I = [ J     m c× ]        B = [ K − ½ n×   0 ]
//!     [ −m c×  m 1 ]            [ −f×        0 ]
//!
//! K = ½ (ω× J + (ω× J)ᵀ − m (c vᵀ + v cᵀ)) + m (c·v) 1
//! ```
//!
//! so that the sums over a composite body consist of a few 3-vectors and symmetric matrices.
//!
//! Source: Echeandia and Wensing 2021, *Numerical methods to compute the Coriolis matrix and
//! Christoffel symbols for rigid-body systems*, J. Comput. Nonlinear Dynam. 16, 091004.

use std::ops::Range;

use nalgebra::DMatrix;

use super::composite::{Composite, Momentum, Symmetric};
use super::joint::{Joint, Motion, free};
use super::kinematics::Kinematics;
use super::model::Model;
use crate::scalar::Vec3;

/// Scratch of [`coriolis_matrix`], allocated once for a model.
#[derive(Clone, Debug, Default)]
pub struct CoriolisScratch {
    velocity: Vec<Motion<f64>>,
    turning: Vec<Turning>,
    screws: Vec<Screw>,
    /// The screws of each body's joint.
    own: Vec<Range<usize>>,
}

/// The screw of a velocity at a body's own joint, and its rate.
#[derive(Clone, Copy, Debug)]
struct Screw {
    velocity: usize,
    S: Motion<f64>,
    S_dot: Motion<f64>,
}

/// I and B of a composite body.
#[derive(Clone, Copy, Debug)]
struct Turning {
    I: Composite<f64>,
    K: Symmetric<f64>,
    /// I V.
    P: Momentum<f64>,
}

/// `C(q, v)` (nv, nv) at the poses of `kinematics`, without gravity; `out` is overwritten.
///
/// `v`: (nv). Times a velocity it gives N and N m.
pub fn coriolis_matrix(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    scratch: &mut CoriolisScratch,
    out: &mut DMatrix<f64>,
) {
    let bodies = model.bodies();
    let s = scratch;
    s.velocity.clear();
    s.turning.clear();
    s.screws.clear();
    s.own.clear();
    for (b, body) in bodies.iter().enumerate() {
        let first = s.screws.len();
        let velocity = if let Joint::Free(_) = body.joint {
            s.add_free(body.velocity, v)
        } else {
            let carrier = body.parent.map_or(still(), |parent| s.velocity[parent]);
            let mut velocity = carrier;
            for (i, &S) in kinematics.motions()[body.motions()].iter().enumerate() {
                let k = body.velocity + i;
                velocity.axis += S.axis * v[k];
                velocity.swing += S.swing * v[k];
                s.screws.push(Screw {
                    velocity: k,
                    S,
                    S_dot: carrier.rate_of(&S),
                });
            }
            velocity
        };
        s.velocity.push(velocity);
        s.own.push(first..s.screws.len());
        let (link, pose) = (&model.mechanism().links[b], &kinematics.poses().bodies[b]);
        let own = Composite::of(link, &model.inertias().bodies[b], pose);
        s.turning.push(Turning::of(own, &velocity));
    }
    out.fill(0.0);
    for (b, body) in bodies.iter().enumerate().rev() {
        let turning = s.turning[b];
        for t in s.own[b].clone() {
            let Screw {
                velocity: k,
                S,
                S_dot,
            } = &s.screws[t];
            let F1 = turning.I.momentum(S_dot).plus(&turning.B_times(S));
            let F2 = turning.I.momentum(S);
            let F3 = turning.B_transposed_times(S);
            let mut carrier = Some(b);
            while let Some(a) = carrier {
                for before in s.screws[s.own[a].clone()]
                    .iter()
                    .take_while(|x| a < b || x.velocity < *k)
                {
                    out[(before.velocity, *k)] += F1.along(&before.S);
                    out[(*k, before.velocity)] += F2.along(&before.S_dot) + before.S.axis.dot(F3);
                }
                carrier = bodies[a].parent;
            }
            out[(*k, *k)] += F1.along(S);
        }
        if let Some(parent) = body.parent {
            s.turning[parent] = s.turning[parent].plus(&turning);
        }
    }
}

impl CoriolisScratch {
    /// Adds the six screws of a free body and returns its velocity.
    fn add_free(&mut self, first: usize, v: &[f64]) -> Motion<f64> {
        let base = free::velocity(&v[first..]);
        for (k, [S, S_dot]) in free::screws_and_rates(&base).into_iter().enumerate() {
            self.screws.push(Screw {
                velocity: first + k,
                S,
                S_dot,
            });
        }
        base
    }
}

fn still() -> Motion<f64> {
    let zero = Vec3::new(0.0, 0.0, 0.0);
    Motion {
        axis: zero,
        swing: zero,
    }
}

impl Turning {
    /// I and B of a single body with the velocity V.
    #[inline]
    fn of(I: Composite<f64>, V: &Motion<f64>) -> Self {
        let (J, w, v, s) = (&I.inertia, V.axis, V.swing, I.moment);
        let x = w.cross(Vec3::new(J.xx, J.xy, J.xz));
        let y = w.cross(Vec3::new(J.xy, J.yy, J.yz));
        let z = w.cross(Vec3::new(J.xz, J.yz, J.zz));
        let along = s.dot(v);
        let K = Symmetric {
            xx: x.x - s.x * v.x + along,
            yy: y.y - s.y * v.y + along,
            zz: z.z - s.z * v.z + along,
            xy: 0.5 * (x.y + y.x - s.x * v.y - s.y * v.x),
            xz: 0.5 * (x.z + z.x - s.x * v.z - s.z * v.x),
            yz: 0.5 * (y.z + z.y - s.y * v.z - s.z * v.y),
        };
        Self {
            I,
            K,
            P: I.momentum(V),
        }
    }

    /// `B S`.
    #[inline]
    fn B_times(&self, S: &Motion<f64>) -> Momentum<f64> {
        Momentum {
            angular: self.K.times(S.axis) - self.P.angular.cross(S.axis) * 0.5,
            linear: -self.P.linear.cross(S.axis),
        }
    }

    /// `Bᵀ S`, whose linear part is zero.
    #[inline]
    fn B_transposed_times(&self, S: &Motion<f64>) -> Vec3<f64> {
        let P = &self.P;
        self.K.times(S.axis) + P.angular.cross(S.axis) * 0.5 + P.linear.cross(S.swing)
    }

    #[inline]
    fn plus(&self, other: &Self) -> Self {
        Self {
            I: self.I.plus(&other.I),
            K: self.K.plus(&other.K),
            P: self.P.plus(&other.P),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Vector3};

    use super::*;
    use crate::multibody::Configuration;

    fn somewhere(model: &Model) -> (Configuration, Vec<f64>) {
        let mut q = Configuration::zero(model);
        let v: Vec<f64> = (0..model.nv()).map(|k| (1.7 * k as f64).sin()).collect();
        let turn: Vec<f64> = (0..model.nv()).map(|k| (0.3 + k as f64).cos()).collect();
        q.advance(model, &turn, 1.0);
        (q, v)
    }

    /// The rover, and the rover with welded joints, whose bodies have their mass centres off their
    /// origins.
    fn models() -> [Model; 2] {
        let rover = Model::rover();
        let joints = [
            ("right_bogie".to_owned(), 0.3),
            ("steering_FL".to_owned(), -0.4),
        ];
        let welded = rover.with_locked_joints(&joints).unwrap();
        [rover, welded]
    }

    #[test]
    fn times_the_velocity_it_is_the_bias_of_newton_and_euler() {
        for model in models() {
            let (q, v) = somewhere(&model);
            let kinematics = Kinematics::of(&model, &q);
            let mut C = DMatrix::zeros(model.nv(), model.nv());
            coriolis_matrix(
                &model,
                &kinematics,
                &v,
                &mut CoriolisScratch::default(),
                &mut C,
            );
            let product = &C * DVector::from_column_slice(&v);
            let expected = kinematics.bias(&model, &v, &Vector3::zeros());
            let expected = DVector::from_vec(expected);
            assert!((product - &expected).norm() < 1e-12 * expected.norm());
        }
    }

    #[test]
    fn with_its_transpose_it_is_the_rate_of_the_mass_matrix() {
        for model in models() {
            let (q, v) = somewhere(&model);
            let mut C = DMatrix::zeros(model.nv(), model.nv());
            let kinematics = Kinematics::of(&model, &q);
            coriolis_matrix(
                &model,
                &kinematics,
                &v,
                &mut CoriolisScratch::default(),
                &mut C,
            );
            let h = 1e-5;
            let mass_matrix_at = |time: f64| {
                let mut moved = q.clone();
                moved.advance(&model, &v, time);
                Kinematics::of(&model, &moved).mass_matrix(&model)
            };
            let rate = (mass_matrix_at(h) - mass_matrix_at(-h)) / (2.0 * h);
            assert!((&C + C.transpose() - &rate).norm() < 1e-8 * rate.norm());
        }
    }
}
