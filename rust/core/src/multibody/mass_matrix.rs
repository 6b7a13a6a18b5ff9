//! Mass matrix by the composite rigid body algorithm.
//!
//! Entries are stored along paths: the row of a joint's velocity is its six entries with the free
//! root of its tree, the base, then those with the velocities before it on its path, then its own.
//! An ancestor's row is then a prefix of its descendants' rows, so that factorisation and solves
//! are dense loops over short segments and skip all structural zeros. The block of the base is
//! apart, by the rows of its lower triangle. A tree without a base has the unit block, and zeros in
//! its rows: a base that nothing moves.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 6 (composite bodies), ch. 8
//! (branch-induced sparsity).

use std::cmp::Ordering;

use nalgebra::DMatrix;

use super::factor::{BLOCK, Factor, Rows};
use super::inertias::{Inertia, Inertias};
use super::mechanism::{BASE, Link, Mechanism, TreeSpan};
use super::poses::{Motion, Pose, Poses};
use crate::scalar::{Lane, Vec3};

/// The mass matrix; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix<T: Lane> {
    token: T::Token,
    rows: Rows<T>,
    composites: Vec<Composite<T>>,
    /// Momenta at a unit of each coupled joint's motion.
    coupled: Vec<Momentum<T>>,
}

/// Momentum, and angular momentum about the tree's origin.
#[derive(Clone, Copy, Debug)]
struct Momentum<T> {
    linear: Vec3<T>,
    angular: Vec3<T>,
}

/// Mass, first moment and inertia of a body and everything it carries, about the tree's origin.
#[derive(Clone, Copy, Debug)]
struct Composite<T> {
    mass: T,
    moment: Vec3<T>,
    inertia: Symmetric<T>,
}

/// A symmetric matrix.
#[derive(Clone, Copy, Debug)]
struct Symmetric<T> {
    xx: T,
    yy: T,
    zz: T,
    xy: T,
    xz: T,
    yz: T,
}

impl<T: Lane> Symmetric<T> {
    #[inline(always)]
    fn times(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// Adds `k a aᵀ`.
    #[inline(always)]
    fn add_square(&mut self, k: T, a: Vec3<T>) {
        let ka = a * k;
        self.xx += ka.x * a.x;
        self.yy += ka.y * a.y;
        self.zz += ka.z * a.z;
        self.xy += ka.x * a.y;
        self.xz += ka.x * a.z;
        self.yz += ka.y * a.z;
    }
}

impl<T: Lane> Composite<T> {
    /// A single body.
    #[inline(always)]
    fn of(link: &Link, inertia: &Inertia<T>, pose: &Pose<T>) -> Self {
        let Inertia { mass, rest, .. } = *inertia;
        let Vec3 { x, y, z } = pose.c;
        let moment = pose.c * mass;
        let (xx, yy, zz) = (moment.x * x, moment.y * y, moment.z * z);
        // About the tree's origin: m (|c|² 1 − c cᵀ) more than about the mass centre.
        let mut sum = Symmetric {
            xx: rest + (yy + zz),
            yy: rest + (xx + zz),
            zz: rest + (xx + yy),
            xy: -(moment.x * y),
            xz: -(moment.x * z),
            yz: -(moment.y * z),
        };
        let (a, b) = inertia.axes(link.symmetry, &pose.R);
        sum.add_square(inertia.first, a);
        if let Some(b) = b {
            sum.add_square(inertia.second, b);
        }
        Self {
            mass,
            moment,
            inertia: sum,
        }
    }

    /// Momentum at unit rate of a motion.
    #[inline(always)]
    fn momentum(&self, motion: &Motion<T>) -> Momentum<T> {
        Momentum {
            linear: motion.swing * self.mass + motion.axis.cross(self.moment),
            angular: self.inertia.times(motion.axis) + self.moment.cross(motion.swing),
        }
    }

    /// Its products with the motions of a free root.
    #[inline(always)]
    fn block(&self) -> [T; BLOCK] {
        let (m, s, I) = (self.mass, self.moment, self.inertia);
        let o = m.like(0.0);
        [
            m, //
            o, m, //
            o, o, m, //
            o, -s.z, s.y, I.xx, //
            s.z, o, -s.x, I.xy, I.yy, //
            -s.y, s.x, o, I.xz, I.yz, I.zz,
        ]
    }

    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        let (a, b) = (&self.inertia, &other.inertia);
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            inertia: Symmetric {
                xx: a.xx + b.xx,
                yy: a.yy + b.yy,
                zz: a.zz + b.zz,
                xy: a.xy + b.xy,
                xz: a.xz + b.xz,
                yz: a.yz + b.yz,
            },
        }
    }
}

impl<T: Lane> MassMatrix<T> {
    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = T::splat(token, 0.0);
        let composite = Composite {
            mass: zero,
            moment: Vec3::new(zero, zero, zero),
            inertia: Symmetric {
                xx: zero,
                yy: zero,
                zz: zero,
                xy: zero,
                xz: zero,
                yz: zero,
            },
        };
        let nothing = Momentum {
            linear: composite.moment,
            angular: composite.moment,
        };
        Self {
            token,
            rows: Rows::new(token, mechanism),
            composites: vec![composite; mechanism.n_bodies()],
            coupled: vec![nothing; mechanism.coupled.len()],
        }
    }

    /// Recomputes M at the poses, rotors included.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn update(&mut self, mechanism: &Mechanism, inertias: &Inertias<T>, poses: &Poses<T>) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.update_here(mechanism, inertias, poses),
        );
    }

    #[inline(always)]
    fn update_here(&mut self, mechanism: &Mechanism, inertias: &Inertias<T>, poses: &Poses<T>) {
        let n = mechanism.links.len();
        let links = &mechanism.links[..n];
        let rotors = &inertias.rotors;
        let (bodies, inertias) = (&poses.bodies[..n], &inertias.bodies[..n]);
        let carried = &mut self.composites[..n];
        let motions = &poses.motions[..mechanism.n_motions()];
        let n_rows = mechanism.rows.len();
        let (rows, base) = (&mechanism.rows[..n_rows], &mut self.rows.base[..n_rows]);
        let columns = &mechanism.column_motions[..];
        let entries = &mut self.rows.joints[..columns.len()];
        let (mut row, mut n_coupled) = (n_rows, mechanism.coupled.len());
        for (t, tree) in mechanism.trees.iter().enumerate().rev() {
            let root = tree.bodies.start;
            for b in (root + 1..tree.bodies.end).rev() {
                let (link, pose) = (&links[b], &bodies[b]);
                let mut composite = Composite::of(link, &inertias[b], pose);
                if !link.is_leaf {
                    composite = composite.plus(&carried[b]);
                }
                if link.n_rows == 1 {
                    row -= 1;
                    let own = composite.momentum(&motions[link.motion]);
                    base[row] = own.entries();
                    let (start, end) = (rows[row].start, rows[row].end);
                    own.along_all(motions, &columns[start..end], &mut entries[start..end]);
                } else if link.is_coupled() {
                    n_coupled -= 1;
                    self.coupled[n_coupled] = composite.momentum(&motions[link.motion]);
                } else {
                    for m in (link.motion..link.motion + link.n_rows).rev() {
                        row -= 1;
                        let own = composite.momentum(&motions[m]);
                        base[row] = own.entries();
                        let own_row = rows[row].clone();
                        own.along_all(motions, &columns[own_row.clone()], &mut entries[own_row]);
                    }
                }
                carried[link.parent] = if link.is_last {
                    composite
                } else {
                    carried[link.parent].plus(&composite)
                };
            }
            let mut trunk = Composite::of(&links[root], &inertias[root], &bodies[root]);
            if tree.bodies.len() > 1 {
                trunk = trunk.plus(&carried[root]);
            }
            if tree.is_free {
                self.rows.blocks[t] = trunk.block();
            } else {
                let motion = links[root].motion;
                for (m, own_row) in (motion..).zip(&rows[tree.rows.start..row]) {
                    let own = trunk.momentum(&motions[m]);
                    own.along_all(
                        motions,
                        &columns[own_row.clone()],
                        &mut entries[own_row.clone()],
                    );
                }
                row = tree.rows.start;
            }
        }
        for k in 0..mechanism.coupled.len() {
            self.add_coupled(mechanism, poses, k);
        }
        for (&joint, &inertia) in mechanism.rotors.iter().zip(rotors) {
            self.add_to_diagonal(mechanism, mechanism.joints[joint].velocity, inertia);
        }
        for (t, tree) in mechanism.trees.iter().enumerate() {
            if !tree.is_free {
                self.rows.fix_base(t, tree);
            }
        }
    }

    /// Adds the products of a coupled joint's motion with all motions that move its carrier, and
    /// with itself.
    #[inline(always)]
    fn add_coupled(&mut self, mechanism: &Mechanism, poses: &Poses<T>, number: usize) {
        let (link, own) = (
            &mechanism.links[mechanism.coupled[number]],
            self.coupled[number],
        );
        let k = link.velocity;
        let rows = &mut self.rows;
        let own_row = mechanism.diagonals[k];
        rows.joints[own_row] += own.along(&poses.motions[link.motion]);
        let row = mechanism.row_of(k);
        let first = mechanism.rows[row].start;
        for (entry, x) in rows.base[row].iter_mut().zip(own.entries()) {
            *entry += x;
        }
        for (p, mover) in mechanism.movers(link.parent).iter().enumerate() {
            let shared = own.along(&poses.motions[mover.motion]);
            match mover.velocity.cmp(&k) {
                Ordering::Less => rows.joints[first + p] += shared,
                Ordering::Equal => rows.joints[own_row] += shared + shared,
                Ordering::Greater => {
                    let below = mechanism.rows[mechanism.row_of(mover.velocity)].start;
                    rows.joints[below + (own_row - first)] += shared;
                }
            }
        }
    }

    /// Diagonal entry of a joint's velocity.
    #[inline(always)]
    pub fn diagonal(&self, mechanism: &Mechanism, velocity: usize) -> T {
        self.rows.joints[mechanism.diagonals[velocity]]
    }

    /// Adds the implicit terms of a held joint to the diagonal entry of its velocity.
    #[inline(always)]
    pub fn add_to_diagonal(&mut self, mechanism: &Mechanism, velocity: usize, value: T) {
        self.rows.joints[mechanism.diagonals[velocity]] += value;
    }

    /// Calls `entry(i, j, x)` for the entries of the lower triangle, `i >= j`.
    fn for_each(&self, mechanism: &Mechanism, mut entry: impl FnMut(usize, usize, T)) {
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let TreeSpan {
                velocities, rows, ..
            } = tree;
            let (base, lead) = (velocities.start, tree.lead());
            for i in 0..lead {
                for j in 0..=i {
                    entry(base + i, base + j, self.rows.blocks[t][i * (i + 1) / 2 + j]);
                }
            }
            for (row, i) in rows.clone().zip(base + lead..) {
                for (j, x) in self.rows.base[row][..lead].iter().enumerate() {
                    entry(i, base + j, *x);
                }
                let own = mechanism.rows[row].clone();
                let columns = mechanism.columns[own.clone()].iter();
                for (j, x) in columns.zip(&self.rows.joints[own]) {
                    entry(i, base + lead + j, *x);
                }
            }
        }
    }

    /// `M v` (nv).
    pub fn times(&self, mechanism: &Mechanism, v: &[T], out: &mut [T]) {
        out.fill(T::splat(self.token, 0.0));
        self.for_each(mechanism, |i, j, x| {
            out[i] += x * v[j];
            if i != j {
                out[j] += x * v[i];
            }
        });
    }

    /// Lane `lane` as a full symmetric matrix (nv, nv).
    #[must_use]
    pub fn to_dense(&self, mechanism: &Mechanism, lane: usize) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(mechanism.nv(), mechanism.nv());
        self.add_to_dense(mechanism, lane, &mut dense);
        dense
    }

    /// Adds lane `lane` to a full matrix (nv, nv).
    pub fn add_to_dense(&self, mechanism: &Mechanism, lane: usize, dense: &mut DMatrix<f64>) {
        self.for_each(mechanism, |i, j, x| {
            dense[(i, j)] += x.get(lane);
            if i != j {
                dense[(j, i)] += x.get(lane);
            }
        });
    }

    /// Computes `M = Lᵀ D L`. Returns where M is positive definite; the factor of any other lane
    /// has no meaning.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn factorise(&self, mechanism: &Mechanism, factor: &mut Factor<T>) -> T::Mask {
        factor.rows.clone_from(&self.rows);
        factor.update(self.token, mechanism)
    }

    /// The same without a copy: it leaves M undefined until [`Self::update`].
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn factorise_in_place(&mut self, mechanism: &Mechanism, factor: &mut Factor<T>) -> T::Mask {
        std::mem::swap(&mut factor.rows, &mut self.rows);
        factor.update(self.token, mechanism)
    }
}

impl<T: Lane> Momentum<T> {
    /// Its products with the motions of the base.
    #[inline(always)]
    fn entries(&self) -> [T; BASE] {
        let (f, l) = (self.linear, self.angular);
        [f.x, f.y, f.z, l.x, l.y, l.z]
    }

    /// Its products with motions, by their indices.
    #[inline(always)]
    fn along_all(&self, motions: &[Motion<T>], indices: &[usize], out: &mut [T]) {
        for p in 0..indices.len() {
            out[p] = self.along(&motions[indices[p]]);
        }
    }

    /// Its product with a motion.
    #[inline(always)]
    fn along(&self, motion: &Motion<T>) -> T {
        motion.power(self.linear, self.angular)
    }
}
