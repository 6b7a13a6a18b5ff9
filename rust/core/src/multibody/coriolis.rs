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

use std::ops::{Add, AddAssign, Mul, Range};

use nalgebra::{DMatrix, Vector3};

use super::joint::Joint;
use super::kinematics::Kinematics;
use super::model::{Body, Model};
use crate::spatial::SymmetricMatrix3;

/// Scratch of [`coriolis_matrix`], allocated once for a model.
#[derive(Clone, Debug, Default)]
pub struct CoriolisScratch {
    velocity: Vec<Spatial>,
    composites: Vec<Composite>,
    screws: Vec<Screw>,
    /// The screws of each body's joint.
    own: Vec<Range<usize>>,
}

/// The screw of a velocity at a body's own joint, and its rate.
#[derive(Clone, Copy, Debug)]
struct Screw {
    velocity: usize,
    S: Spatial,
    S_dot: Spatial,
}

/// A motion vector (linear part: velocity of the point at the tree's origin) or a force vector
/// (moment about the origin).
#[derive(Clone, Copy, Debug, Default)]
struct Spatial {
    angular: Vector3<f64>,
    linear: Vector3<f64>,
}

/// I and B of a composite body: a body and everything it carries.
#[derive(Clone, Copy, Debug, Default)]
struct Composite {
    mass: f64,
    moment: Vector3<f64>,
    J: SymmetricMatrix3,
    K: SymmetricMatrix3,
    momentum: Spatial,
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
    s.velocity.resize(bodies.len(), Spatial::default());
    s.composites.resize(bodies.len(), Composite::default());
    s.screws.clear();
    s.own.clear();
    for (b, body) in bodies.iter().enumerate() {
        let first = s.screws.len();
        s.velocity[b] = if let Joint::Free(_) = body.joint {
            s.add_free(body.velocity, v)
        } else {
            let carrier = (body.parent).map_or(Spatial::default(), |parent| s.velocity[parent]);
            let mut velocity = carrier;
            for (i, motion) in kinematics.motions()[body.motions()].iter().enumerate() {
                let S = Spatial {
                    angular: motion.axis.into(),
                    linear: motion.swing.into(),
                };
                let k = body.velocity + i;
                velocity = velocity + S * v[k];
                s.screws.push(Screw {
                    velocity: k,
                    S,
                    S_dot: carrier.moves(&S),
                });
            }
            velocity
        };
        s.own.push(first..s.screws.len());
        s.composites[b] = Composite::of(body, kinematics, b, &s.velocity[b]);
    }
    out.fill(0.0);
    for (b, body) in bodies.iter().enumerate().rev() {
        let composite = s.composites[b];
        for t in s.own[b].clone() {
            let Screw {
                velocity: k,
                S,
                S_dot,
            } = &s.screws[t];
            let F1 = composite.times(S_dot) + composite.B_times(S);
            let F2 = composite.times(S);
            let F3 = composite.B_transposed_times(S);
            let mut carrier = Some(b);
            while let Some(a) = carrier {
                for before in s.screws[s.own[a].clone()]
                    .iter()
                    .take_while(|x| a < b || x.velocity < *k)
                {
                    out[(before.velocity, *k)] += before.S.dot(&F1);
                    out[(*k, before.velocity)] += before.S_dot.dot(&F2) + before.S.angular.dot(&F3);
                }
                carrier = bodies[a].parent;
            }
            out[(*k, *k)] += S.dot(&F1);
        }
        if let Some(parent) = body.parent {
            s.composites[parent] += composite;
        }
    }
}

impl CoriolisScratch {
    /// Adds the six screws of a free body and returns its velocity.
    fn add_free(&mut self, first: usize, v: &[f64]) -> Spatial {
        let v = &v[first..];
        let base = Spatial {
            angular: Vector3::new(v[3], v[4], v[5]),
            linear: Vector3::new(v[0], v[1], v[2]),
        };
        let zero = Vector3::zeros();
        for k in 0..3 {
            self.screws.push(Screw {
                velocity: first + k,
                S: Spatial {
                    angular: zero,
                    linear: Vector3::ith(k, 1.0),
                },
                S_dot: Spatial::default(),
            });
        }
        for k in 0..3 {
            let e = Vector3::ith(k, 1.0);
            // The body rotates about its own origin, which moves.
            self.screws.push(Screw {
                velocity: first + 3 + k,
                S: Spatial {
                    angular: e,
                    linear: zero,
                },
                S_dot: Spatial {
                    angular: zero,
                    linear: base.linear.cross(&e),
                },
            });
        }
        base
    }
}

impl Spatial {
    #[inline]
    fn dot(&self, other: &Self) -> f64 {
        self.angular.dot(&other.angular) + self.linear.dot(&other.linear)
    }

    /// `V× S`: the rate of a motion vector S carried along at the velocity V.
    #[inline]
    fn moves(&self, S: &Self) -> Self {
        Self {
            angular: self.angular.cross(&S.angular),
            linear: self.linear.cross(&S.angular) + self.angular.cross(&S.linear),
        }
    }
}

impl Add for Spatial {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            angular: self.angular + other.angular,
            linear: self.linear + other.linear,
        }
    }
}

impl Mul<f64> for Spatial {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self {
            angular: self.angular * factor,
            linear: self.linear * factor,
        }
    }
}

impl Composite {
    /// I and B of a single body with velocity V.
    #[inline]
    fn of(body: &Body, kinematics: &Kinematics, b: usize, V: &Spatial) -> Self {
        let (c, m) = (kinematics.c(b), body.mass);
        let A = body.principal_attitude(kinematics.R(b));
        let mut J = SymmetricMatrix3::rotated_diagonal(&A, &body.principal_inertia);
        J += SymmetricMatrix3::point_mass(m, &c);
        let (w, v) = (&V.angular, &V.linear);
        let turned = w.cross_matrix() * J.to_matrix();
        let moved = c * v.transpose() * m;
        let K = (turned + turned.transpose() - moved - moved.transpose()) * 0.5;
        let mut K = SymmetricMatrix3::from_matrix(&K);
        let along = m * c.dot(v);
        K.xx += along;
        K.yy += along;
        K.zz += along;
        let mut own = Self {
            mass: m,
            moment: c * m,
            J,
            K,
            momentum: Spatial::default(),
        };
        own.momentum = own.times(V);
        own
    }

    /// `I S`.
    #[inline]
    fn times(&self, S: &Spatial) -> Spatial {
        Spatial {
            angular: self.J.times(&S.angular) + self.moment.cross(&S.linear),
            linear: S.linear * self.mass - self.moment.cross(&S.angular),
        }
    }

    /// `B S`.
    #[inline]
    fn B_times(&self, S: &Spatial) -> Spatial {
        let P = &self.momentum;
        Spatial {
            angular: self.K.times(&S.angular) - P.angular.cross(&S.angular) * 0.5,
            linear: -P.linear.cross(&S.angular),
        }
    }

    /// `Bᵀ S`, whose linear part is zero.
    #[inline]
    fn B_transposed_times(&self, S: &Spatial) -> Vector3<f64> {
        let P = &self.momentum;
        self.K.times(&S.angular) + P.angular.cross(&S.angular) * 0.5 + P.linear.cross(&S.linear)
    }
}

impl AddAssign for Composite {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.J += other.J;
        self.K += other.K;
        self.momentum = self.momentum + other.momentum;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::multibody::Configuration;

    fn somewhere(model: &Model) -> (Configuration, Vec<f64>) {
        let mut q = Configuration::zero(model);
        let v: Vec<f64> = (0..model.nv()).map(|k| (1.7 * k as f64).sin()).collect();
        let turn: Vec<f64> = (0..model.nv()).map(|k| (0.3 + k as f64).cos()).collect();
        q.advance(model, &turn, 1.0);
        (q, v)
    }

    /// Also with welded joints, whose bodies have their mass centres off their origins.
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
