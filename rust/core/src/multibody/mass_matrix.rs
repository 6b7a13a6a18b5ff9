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

use super::composite::{Composite, TreeMomentum};
use super::factor::{Factor, PathFactor};
use super::inertias::Inertias;
use super::mechanism::{Mechanism, TreeSpan};
use super::path_matrix::{PathMatrix, product};
use super::poses::Poses;
use crate::scalar::{Lane, inlined};

/// The mass matrix; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix<T: Lane> {
    token: T::Token,
    pub(super) rows: PathFactor<T>,
    composites: Vec<Composite<T>>,
    /// Momenta at a unit of each coupled joint's motion.
    coupled: Vec<TreeMomentum<T>>,
}

impl<T: Lane> MassMatrix<T> {
    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            token,
            rows: PathFactor::new(token, mechanism),
            composites: vec![Composite::zero(zero); mechanism.n_bodies()],
            coupled: vec![TreeMomentum::zero(zero); mechanism.coupled.len()],
        }
    }

    /// Recomputes M at the poses, rotors included.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn update(&mut self, mechanism: &Mechanism, inertias: &Inertias<T>, poses: &Poses<T>) {
        inlined!(
            T::vectorize,
            self.token,
            self.update_here(mechanism, inertias, poses)
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
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            for b in (root + 1..end).rev() {
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

    /// Adds a symmetric matrix over the velocities of a body's path: `entry` gives that of two
    /// places on the path. Entries between velocities of which none moves the other's body are left
    /// out.
    #[inline(always)]
    pub(crate) fn add_quadratic(
        &mut self,
        mechanism: &Mechanism,
        path: &[usize],
        entry: impl Fn(usize, usize) -> T,
    ) {
        let Some(&first) = path.first() else { return };
        let t = mechanism.tree_of[first];
        let lead = mechanism.trees[t].lead();
        let joints = mechanism.trees[t].velocities.start + lead;
        let block = self.rows.blocks[t].iter_mut();
        let pairs = (0..lead).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for (sum, (i, j)) in block.zip(pairs) {
            *sum += entry(i, j);
        }
        for (p, &k) in path.iter().enumerate().skip(lead) {
            let row = mechanism.row_of(k);
            for (j, sum) in self.rows.base[row].iter_mut().enumerate().take(lead) {
                *sum += entry(p, j);
            }
            let own = mechanism.rows[row].clone();
            let columns = &mechanism.columns[own.clone()];
            for (q, &j) in path.iter().enumerate().skip(lead) {
                let at = columns.iter().position(|&column| joints + column == j);
                if let Some(at) = at {
                    self.rows.joints[own.start + at] += entry(p, q);
                }
            }
        }
    }

    /// Calls `entry(i, j, x)` for the entries of the lower triangle, `i >= j`.
    #[inline(always)]
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
    #[inline(always)]
    pub fn times(&self, mechanism: &Mechanism, v: &[T], out: &mut [T]) {
        product(mechanism, [&self.rows, &self.rows], v, out);
    }

    /// `A = M + a C`.
    #[inline(always)]
    pub(crate) fn add_scaled(&self, a: T, C: &PathMatrix<T>, A: &mut PathMatrix<T>) {
        A.lower.set_sum(&self.rows, a, &C.lower);
        A.upper.set_sum(&self.rows, a, &C.upper);
    }

    /// Lane `lane` as a full symmetric matrix (nv, nv).
    #[must_use]
    pub fn to_dense(&self, mechanism: &Mechanism, lane: usize) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(mechanism.nv(), mechanism.nv());
        self.for_each(mechanism, |i, j, x| {
            dense[(i, j)] = x.get(lane);
            dense[(j, i)] = x.get(lane);
        });
        dense
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

    /// Computes `M = Lᵀ D L` without a copy, which leaves M undefined until [`Self::update`].
    /// Returns where M is positive definite; the factor of any other lane has no meaning.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn factorise_in_place(&mut self, mechanism: &Mechanism, factor: &mut Factor<T>) -> T::Mask {
        std::mem::swap(&mut factor.rows, &mut self.rows);
        factor.update(self.token, mechanism)
    }
}
