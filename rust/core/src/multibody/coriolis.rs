//! Coriolis matrix `C(q, v)` with `C v = N(q, v) v` and `C + Cᵀ = Ṁ`, used for implicit gyroscopic
//! terms.
//!
//! Its points x, of mass m, move at `J_k v_k` with `J_k = S_k x`; `C_jk = Σ m J_j · J̇_k` is a sum
//! over all of them. Over a body with the inertia I and the spatial velocity V it is
//!
//! ```text
//! C_jk = Σ S_jᵀ (I Ṡ_k + B S_k)      over the bodies that both j and k move
//! ```
//!
//! with `B + Bᵀ = İ` and `B V = V×* I V`, which gives both properties. Spatial vectors are
//! (angular, linear) at the origin of the tree's places, world axes. A velocity that several joints
//! share, as coupled ones do, has a screw of each; their products add.
//!
//! With V = (ω, v), mass m, first moment s and inertia J about that origin, and `f = m v + ω × s`
//!
//! ```text
//! I = [ J    s× ]        B = [ K    0 ]        K = ω× (J − ½ tr J 1) + (s·v) 1 − v sᵀ
//!     [ −s×  m 1 ]           [ −f×  0 ]
//! ```
//!
//! so that the sums over a composite body consist of two matrices and two vectors.
//!
//! The translation of a free root does not enter C: velocities are taken relative to its origin,
//! where the screws of its base have no rates, and the columns of its translations are zero.
//!
//! Source: Echeandia and Wensing 2021, *Numerical methods to compute the Coriolis matrix and
//! Christoffel symbols for rigid-body systems*, J. Comput. Nonlinear Dynam. 16, 091004.

#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::cmp::Ordering;

use super::composite::{BLOCK, Composite, TreeMomentum};
use super::inertias::Inertias;
use super::joint::{Joint, JointModel, Motion};
use super::mechanism::{BASE, Mechanism};
use super::path_matrix::PathMatrix;
use super::poses::Poses;
use crate::scalar::{Lane, Mat3, Vec3, inlined};

/// Scratch of [`coriolis_matrix`].
#[derive(Clone, Debug)]
pub(crate) struct CoriolisScratch<T: Lane> {
    token: T::Token,
    /// Velocity of each body.
    velocity: Vec<Motion<T>>,
    /// I and B of what each body carries.
    carried: Vec<Turning<T>>,
    /// Ṡ of each motion.
    rates: Vec<Motion<T>>,
    /// The shares of coupled joints.
    coupled: Vec<Share<T>>,
}

/// I and B of a composite body.
#[derive(Clone, Copy, Debug)]
struct Turning<T> {
    I: Composite<T>,
    K: Mat3<T>,
    f: Vec3<T>,
}

/// What a composite body adds to C by the screw S of the joint that carries it.
#[derive(Clone, Copy, Debug)]
struct Share<T> {
    /// `I Ṡ + B S`.
    column: TreeMomentum<T>,
    /// `I S`.
    row: TreeMomentum<T>,
    /// `Bᵀ S`, whose linear part is zero.
    turned: Vec3<T>,
}

/// `C(q, v)` and the bias `G` of gravity (nv) at the poses of a step; both are overwritten.
///
/// `v`: (nv); `gravity`: m/s². C times a velocity, and G, are in N and N m.
///
/// # Panics
/// If an argument is of another mechanism.
pub(crate) fn coriolis_matrix<T: Lane>(
    mechanism: &Mechanism,
    (inertias, poses): (&Inertias<T>, &Poses<T>),
    v: &[T],
    gravity: Vec3<T>,
    scratch: &mut CoriolisScratch<T>,
    (C, G): (&mut PathMatrix<T>, &mut [T]),
) {
    inlined!(T::vectorize, scratch.token, {
        scratch.find_rates(mechanism, poses, v);
        scratch.multiply(mechanism, (inertias, poses), gravity, (C, G));
    });
}

impl<T: Lane> CoriolisScratch<T> {
    /// Room for a mechanism.
    pub(crate) fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let none = Vec3::splat(token, [0.0; 3]);
        let still = Motion {
            axis: none,
            swing: none,
        };
        let nothing = Turning::of(Composite::zero(none.x), &still);
        let n_coupled = mechanism.coupled.len();
        Self {
            token,
            velocity: vec![still; mechanism.n_bodies()],
            carried: vec![nothing; mechanism.n_bodies()],
            rates: vec![still; mechanism.n_motions()],
            coupled: vec![nothing.share(&still, &still); n_coupled],
        }
    }

    /// Velocities of the bodies, relative to the origins of free roots, and rates of the screws.
    #[inline(always)]
    fn find_rates(&mut self, mechanism: &Mechanism, poses: &Poses<T>, v: &[T]) {
        let none = Vec3::splat(self.token, [0.0; 3]);
        for (b, link) in mechanism.links.iter().enumerate() {
            let mut velocity = if link.parent == b {
                Motion {
                    axis: none,
                    swing: none,
                }
            } else {
                self.velocity[link.parent]
            };
            if let Joint::Free(_) = link.joint {
                let turn = &v[link.velocity + 3..][..3];
                velocity.axis = Vec3::new(turn[0], turn[1], turn[2]);
            }
            let carrier = velocity;
            for i in 0..link.joint.n_motions() {
                let S = &poses.motions[link.motion + i];
                self.rates[link.motion + i] = carrier.rate_of(S);
                velocity.axis += S.axis * v[link.velocity + i];
                velocity.swing += S.swing * v[link.velocity + i];
            }
            self.velocity[b] = velocity;
        }
    }

    /// The matrix and the bias from the rates, from the leaves to the roots.
    #[inline(always)]
    fn multiply(
        &mut self,
        mechanism: &Mechanism,
        (inertias, poses): (&Inertias<T>, &Poses<T>),
        gravity: Vec3<T>,
        (C, G): (&mut PathMatrix<T>, &mut [T]),
    ) {
        let (n, n_entries) = (mechanism.links.len(), mechanism.column_motions.len());
        let (links, bodies) = (&mechanism.links[..n], &poses.bodies[..n]);
        let (inertias, velocity) = (&inertias.bodies[..n], &self.velocity[..n]);
        let carried = &mut self.carried[..n];
        let columns = &mechanism.column_motions[..];
        let (motions, rates) = (&poses.motions[..], &self.rates[..]);
        let lower = &mut C.lower.joints[..n_entries];
        let upper = &mut C.upper.joints[..n_entries];
        let mut n_coupled = mechanism.coupled.len();
        for (t, tree) in mechanism.trees.iter().enumerate().rev() {
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            let mut row = tree.rows.end;
            for b in (root..end).rev() {
                let link = &links[b];
                let own = Composite::of(link, &inertias[b], &bodies[b]);
                let mut turning = Turning::of(own, &velocity[b]);
                if !link.is_leaf {
                    turning = turning.plus(&carried[b]);
                }
                if b == root && tree.is_free {
                    [C.lower.blocks[t], C.upper.blocks[t]] = turning.blocks();
                    G[tree.velocities.start..][..BASE]
                        .copy_from_slice(&turning.weight(gravity).entries());
                    continue;
                }
                if b > root {
                    let carried = &mut carried[link.parent];
                    *carried = if link.is_last {
                        turning
                    } else {
                        carried.plus(&turning)
                    };
                }
                if b > root && link.is_coupled() {
                    n_coupled -= 1;
                    let m = link.motion;
                    self.coupled[n_coupled] = turning.share(&motions[m], &rates[m]);
                }
                for i in (0..link.n_rows).rev() {
                    row -= 1;
                    let m = link.motion + i;
                    let share = turning.share(&motions[m], &rates[m]);
                    [C.lower.base[row], C.upper.base[row]] = share.base();
                    let (start, last) = (mechanism.rows[row].start, mechanism.rows[row].end - 1);
                    let (columns, n) = (&columns[start..last], last - start);
                    let (lower, upper) = (&mut lower[start..=last], &mut upper[start..last]);
                    for p in 0..n {
                        let column = columns[p];
                        [lower[p], upper[p]] = share.with(&motions[column], &rates[column]);
                    }
                    lower[n] = share.column.along(&motions[m]);
                    G[link.velocity + i] = -gravity.dot(share.row.linear);
                }
            }
        }
        let zero = gravity.x.like(0.0);
        for (t, tree) in (mechanism.trees.iter().enumerate()).filter(|(_, tree)| !tree.is_free) {
            for half in [&mut C.lower, &mut C.upper] {
                half.blocks[t] = [zero; BLOCK];
                half.base[tree.rows.clone()].fill([zero; BASE]);
            }
        }
        for (number, &b) in mechanism.coupled.iter().enumerate() {
            self.add_coupled(mechanism, (b, number), motions, C);
            let link = &mechanism.links[b];
            G[link.velocity] -= gravity.dot(self.coupled[number].row.linear);
        }
    }

    /// Adds the products of a coupled joint's screw with all screws that move its carrier, and with
    /// itself; as in the mass matrix.
    #[inline(always)]
    fn add_coupled(
        &self,
        mechanism: &Mechanism,
        (b, number): (usize, usize),
        motions: &[Motion<T>],
        C: &mut PathMatrix<T>,
    ) {
        let (link, share) = (&mechanism.links[b], &self.coupled[number]);
        let k = link.velocity;
        let diagonal = mechanism.diagonals[k];
        let with = |m: usize| share.with(&motions[m], &self.rates[m]);
        C.lower.joints[diagonal] += with(link.motion)[1];
        let row = mechanism.row_of(k);
        let first = mechanism.rows[row].start;
        for (half, of_base) in [&mut C.lower, &mut C.upper].into_iter().zip(share.base()) {
            for (entry, x) in half.base[row].iter_mut().zip(of_base) {
                *entry += x;
            }
        }
        for (p, mover) in mechanism.movers(link.parent).iter().enumerate() {
            let [lower, upper] = with(mover.motion);
            match mover.velocity.cmp(&k) {
                Ordering::Less => {
                    C.lower.joints[first + p] += lower;
                    C.upper.joints[first + p] += upper;
                }
                Ordering::Equal => C.lower.joints[diagonal] += lower + upper,
                Ordering::Greater => {
                    let below = mechanism.rows[mechanism.row_of(mover.velocity)].start;
                    C.lower.joints[below + (diagonal - first)] += upper;
                    C.upper.joints[below + (diagonal - first)] += lower;
                }
            }
        }
    }
}

impl<T: Lane> Share<T> {
    /// The entries of C with another screw S and its rate: in the row of this screw, and in its
    /// column.
    #[inline(always)]
    fn with(&self, S: &Motion<T>, S_dot: &Motion<T>) -> [T; 2] {
        let in_row = self.row.along(S_dot) + S.axis.dot(self.turned);
        [in_row, self.column.along(S)]
    }

    /// The entries with the screws of a free root.
    #[inline(always)]
    fn base(&self) -> [[T; BASE]; 2] {
        let (Vec3 { x, y, z }, zero) = (self.turned, self.turned.x.like(0.0));
        [[zero, zero, zero, x, y, z], self.column.entries()]
    }
}

impl<T: Lane> Turning<T> {
    /// I and B of a single body with the velocity V.
    #[inline(always)]
    fn of(I: Composite<T>, V: &Motion<T>) -> Self {
        let (J, w, v, s) = (&I.inertia, V.axis, V.swing, I.moment);
        let half = I.mass.like(0.5) * (J.xx + J.yy + J.zz);
        let along = s.dot(v);
        let mut K = Mat3 {
            x: w.cross(Vec3::new(J.xx - half, J.xy, J.xz)) - v * s.x,
            y: w.cross(Vec3::new(J.xy, J.yy - half, J.yz)) - v * s.y,
            z: w.cross(Vec3::new(J.xz, J.yz, J.zz - half)) - v * s.z,
        };
        K.x.x += along;
        K.y.y += along;
        K.z.z += along;
        let f = v * I.mass + w.cross(s);
        Self { I, K, f }
    }

    /// The share of a joint with a screw S and its rate.
    #[inline(always)]
    fn share(&self, S: &Motion<T>, S_dot: &Motion<T>) -> Share<T> {
        let TreeMomentum { linear, angular } = self.I.momentum(S_dot);
        Share {
            column: TreeMomentum {
                linear: linear - self.f.cross(S.axis),
                angular: angular + self.K.times(S.axis),
            },
            row: self.I.momentum(S),
            turned: self.K.transpose_times(S.axis) + self.f.cross(S.swing),
        }
    }

    /// Force and moment in balance with its weight.
    #[inline(always)]
    fn weight(&self, gravity: Vec3<T>) -> TreeMomentum<T> {
        TreeMomentum {
            linear: -gravity * self.I.mass,
            angular: gravity.cross(self.I.moment),
        }
    }

    /// The block of a free root: B about its origin, as lower and transposed upper triangle.
    #[inline(always)]
    fn blocks(&self) -> [[T; BLOCK]; 2] {
        let (Mat3 { x, y, z }, f, o) = (self.K, self.f, self.I.mass.like(0.0));
        let lower = [
            o, //
            o, o, //
            o, o, o, //
            o, o, o, x.x, //
            o, o, o, x.y, y.y, //
            o, o, o, x.z, y.z, z.z,
        ];
        let upper = [
            o, //
            o, o, //
            o, o, o, //
            o, -f.z, f.y, x.x, //
            f.z, o, -f.x, y.x, y.y, //
            -f.y, f.x, o, z.x, z.y, z.z,
        ];
        [lower, upper]
    }

    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        Self {
            I: self.I.plus(&other.I),
            K: Mat3 {
                x: self.K.x + other.K.x,
                y: self.K.y + other.K.y,
                z: self.K.z + other.K.z,
            },
            f: self.f + other.f,
        }
    }
}
