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

#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::ops::Range;

use super::composite::{Composite, Momentum, Symmetric};
use super::inertias::Inertias;
use super::joint::{Joint, JointModel, Motion, free};
use super::mechanism::Mechanism;
use super::poses::Poses;
use crate::scalar::{Lane, Vec3};

/// Scratch of [`coriolis_matrix`], allocated once for a mechanism.
#[derive(Clone, Debug)]
pub struct CoriolisScratch<T: Lane> {
    token: T::Token,
    velocity: Vec<Motion<T>>,
    turning: Vec<Turning<T>>,
    screws: Vec<Screw<T>>,
    /// The screws of each body's joint.
    own: Vec<Range<usize>>,
}

/// The screw of a velocity at a body's own joint, and its rate.
#[derive(Clone, Copy, Debug)]
struct Screw<T> {
    velocity: usize,
    S: Motion<T>,
    S_dot: Motion<T>,
}

/// I and B of a composite body.
#[derive(Clone, Copy, Debug)]
struct Turning<T> {
    I: Composite<T>,
    K: Symmetric<T>,
    /// I V.
    P: Momentum<T>,
}

/// `C(q, v)` (nv, nv) at the poses of a step, without gravity, column after column; `out` is
/// overwritten.
///
/// `v`: (nv). Times a velocity it gives N and N m.
///
/// # Panics
/// If an argument is of another mechanism.
pub fn coriolis_matrix<T: Lane>(
    mechanism: &Mechanism,
    inertias: &Inertias<T>,
    poses: &Poses<T>,
    v: &[T],
    scratch: &mut CoriolisScratch<T>,
    out: &mut [T],
) {
    T::vectorize(
        scratch.token,
        #[inline(always)]
        || {
            scratch.find_screws(mechanism, inertias, poses, v);
            scratch.multiply(mechanism, v.len(), out);
        },
    );
}

impl<T: Lane> CoriolisScratch<T> {
    /// Empty.
    #[must_use]
    pub fn new(token: T::Token) -> Self {
        Self {
            token,
            velocity: Vec::new(),
            turning: Vec::new(),
            screws: Vec::new(),
            own: Vec::new(),
        }
    }

    /// The screws of all velocities, and I and B of each body alone.
    #[inline(always)]
    fn find_screws(
        &mut self,
        mechanism: &Mechanism,
        inertias: &Inertias<T>,
        poses: &Poses<T>,
        v: &[T],
    ) {
        self.velocity.clear();
        self.turning.clear();
        self.screws.clear();
        self.own.clear();
        let none = Vec3::splat(self.token, [0.0; 3]);
        let still = Motion {
            axis: none,
            swing: none,
        };
        for (b, link) in mechanism.links.iter().enumerate() {
            let first = self.screws.len();
            let velocity = if let Joint::Free(_) = link.joint {
                self.add_free(link.velocity, v)
            } else {
                let carrier = if link.parent == b {
                    still
                } else {
                    self.velocity[link.parent]
                };
                let mut velocity = carrier;
                for i in 0..link.joint.n_motions() {
                    let (S, k) = (poses.motions[link.motion + i], link.velocity + i);
                    velocity.axis += S.axis * v[k];
                    velocity.swing += S.swing * v[k];
                    self.screws.push(Screw {
                        velocity: k,
                        S,
                        S_dot: carrier.rate_of(&S),
                    });
                }
                velocity
            };
            self.velocity.push(velocity);
            self.own.push(first..self.screws.len());
            let own = Composite::of(link, &inertias.bodies[b], &poses.bodies[b]);
            self.turning.push(Turning::of(own, &velocity));
        }
    }

    /// Adds the six screws of a free body and returns its velocity.
    #[inline(always)]
    fn add_free(&mut self, first: usize, v: &[T]) -> Motion<T> {
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

    /// The matrix from the screws, from the leaves to the roots.
    #[inline(always)]
    fn multiply(&mut self, mechanism: &Mechanism, nv: usize, out: &mut [T]) {
        out.fill(T::splat(self.token, 0.0));
        for (b, link) in mechanism.links.iter().enumerate().rev() {
            let turning = self.turning[b];
            for t in self.own[b].clone() {
                let Screw {
                    velocity: k,
                    S,
                    S_dot,
                } = &self.screws[t];
                let F1 = turning.I.momentum(S_dot).plus(&turning.B_times(S));
                let F2 = turning.I.momentum(S);
                let F3 = turning.B_transposed_times(S);
                let mut a = b;
                loop {
                    for before in self.screws[self.own[a].clone()]
                        .iter()
                        .take_while(|x| a < b || x.velocity < *k)
                    {
                        let i = before.velocity;
                        out[k * nv + i] += F1.along(&before.S);
                        out[i * nv + k] += F2.along(&before.S_dot) + before.S.axis.dot(F3);
                    }
                    let parent = mechanism.links[a].parent;
                    if parent == a {
                        break;
                    }
                    a = parent;
                }
                out[k * nv + k] += F1.along(S);
            }
            if link.parent != b {
                self.turning[link.parent] = self.turning[link.parent].plus(&turning);
            }
        }
    }
}

impl<T: Lane> Turning<T> {
    /// I and B of a single body with the velocity V.
    #[inline(always)]
    fn of(I: Composite<T>, V: &Motion<T>) -> Self {
        let (J, w, v, s) = (&I.inertia, V.axis, V.swing, I.moment);
        let half = I.mass.like(0.5);
        let x = w.cross(Vec3::new(J.xx, J.xy, J.xz));
        let y = w.cross(Vec3::new(J.xy, J.yy, J.yz));
        let z = w.cross(Vec3::new(J.xz, J.yz, J.zz));
        let along = s.dot(v);
        let K = Symmetric {
            xx: x.x - s.x * v.x + along,
            yy: y.y - s.y * v.y + along,
            zz: z.z - s.z * v.z + along,
            xy: half * (x.y + y.x - s.x * v.y - s.y * v.x),
            xz: half * (x.z + z.x - s.x * v.z - s.z * v.x),
            yz: half * (y.z + z.y - s.y * v.z - s.z * v.y),
        };
        Self {
            I,
            K,
            P: I.momentum(V),
        }
    }

    /// `B S`.
    #[inline(always)]
    fn B_times(&self, S: &Motion<T>) -> Momentum<T> {
        let half = self.I.mass.like(0.5);
        Momentum {
            angular: self.K.times(S.axis) - self.P.angular.cross(S.axis) * half,
            linear: -self.P.linear.cross(S.axis),
        }
    }

    /// `Bᵀ S`, whose linear part is zero.
    #[inline(always)]
    fn B_transposed_times(&self, S: &Motion<T>) -> Vec3<T> {
        let (P, half) = (&self.P, self.I.mass.like(0.5));
        self.K.times(S.axis) + P.angular.cross(S.axis) * half + P.linear.cross(S.swing)
    }

    #[inline(always)]
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
    use nalgebra::{DMatrix, DVector, Vector3};

    use super::*;
    use crate::multibody::{Configuration, Kinematics, Model};
    use crate::scalar::Single;

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

    fn matrix(model: &Model, kinematics: &Kinematics, v: &[f64]) -> DMatrix<f64> {
        let mut C = DMatrix::zeros(model.nv(), model.nv());
        let mut scratch = CoriolisScratch::new(Single::best());
        let (mechanism, inertias) = (model.mechanism(), model.inertias());
        let (poses, out) = (kinematics.poses(), C.as_mut_slice());
        coriolis_matrix(mechanism, inertias, poses, v, &mut scratch, out);
        C
    }

    #[test]
    fn times_the_velocity_it_is_the_bias_of_newton_and_euler() {
        for model in models() {
            let (q, v) = somewhere(&model);
            let kinematics = Kinematics::of(&model, &q);
            let C = matrix(&model, &kinematics, &v);
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
            let kinematics = Kinematics::of(&model, &q);
            let C = matrix(&model, &kinematics, &v);
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
