//! Matrices without symmetry that have the sparsity of the mass matrix.
//!
//! Entries are stored along paths as in [`super::mass_matrix`]: the lower triangle with the
//! diagonal, and the upper one transposed. Elimination from the leaves to the base preserves the
//! sparsity: a velocity changes only rows and columns of its own path.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::factor::{PathFactor, split_base, subtract};
use super::mechanism::{BASE, Mechanism};
use crate::scalar::{Lane, inlined};

/// A matrix (nv, nv) without entries between velocities of which none moves the other's body.
#[derive(Clone, Debug)]
pub(crate) struct PathMatrix<T: Lane> {
    pub(super) lower: PathFactor<T>,
    /// Transposed; its diagonal has no meaning.
    pub(super) upper: PathFactor<T>,
}

/// Index of an entry of a base's block, `j <= i`.
#[inline(always)]
const fn at(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

impl<T: Lane> PathMatrix<T> {
    /// Room for a mechanism.
    pub(crate) fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        Self {
            lower: PathFactor::new(token, mechanism),
            upper: PathFactor::new(token, mechanism),
        }
    }

    /// `A x` (nv).
    #[inline(always)]
    pub(crate) fn times(&self, mechanism: &Mechanism, x: &[T], out: &mut [T]) {
        product(mechanism, [&self.lower, &self.upper], x, out);
    }

    /// `A ← ½ (A − Aᵀ)` for the trees of a cluster, in the lanes of a mask.
    pub(crate) fn keep_skew_part(&mut self, mechanism: &Mechanism, cluster: usize, lanes: T::Mask) {
        let keep = |lower: &mut T, upper: &mut T| {
            let half = upper.like(0.5) * (*upper - *lower);
            *lower = T::select(lanes, -half, *lower);
            *upper = T::select(lanes, half, *upper);
        };
        let clear = |own: &mut T| *own = T::select(lanes, own.like(0.0), *own);
        let (lower, upper) = (&mut self.lower, &mut self.upper);
        for (t, tree) in mechanism.trees.iter().enumerate() {
            if tree.cluster != cluster {
                continue;
            }
            for (lower, upper) in lower.blocks[t].iter_mut().zip(&mut upper.blocks[t]) {
                keep(lower, upper);
            }
            for i in 0..BASE {
                clear(&mut lower.blocks[t][at(i, i)]);
            }
            for row in tree.rows.clone() {
                for (lower, upper) in lower.base[row].iter_mut().zip(&mut upper.base[row]) {
                    keep(lower, upper);
                }
                let own = mechanism.rows[row].clone();
                let upper = upper.joints[own.clone()].iter_mut();
                for (lower, upper) in lower.joints[own.clone()].iter_mut().zip(upper) {
                    keep(lower, upper);
                }
                clear(&mut lower.joints[own.end - 1]);
            }
        }
    }

    /// Solves `A x = b` in place of b (nv) by elimination without exchanges, which leaves A
    /// undefined. Calls `each` with the cluster of each tree and where all of its pivots are
    /// positive, as they are if the symmetric part of A is positive definite.
    pub(crate) fn solve(
        &mut self,
        token: T::Token,
        mechanism: &Mechanism,
        b: &mut [T],
        mut each: impl FnMut(usize, T::Mask),
    ) {
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let of_tree = inlined!(T::vectorize, token, self.solve_tree(mechanism, t, b));
            each(tree.cluster, of_tree);
        }
    }

    #[inline(always)]
    fn solve_tree(&mut self, mechanism: &Mechanism, t: usize, b: &mut [T]) -> T::Mask {
        let tree = &mechanism.trees[t];
        let n = tree.rows.len();
        let (own_rows, columns) = (&mechanism.rows[tree.rows.clone()][..n], &mechanism.columns);
        let mut A = square(&self.lower.blocks[t], &self.upper.blocks[t]);
        let lower = self.lower.of_tree(&tree.rows, columns.len());
        let upper = self.upper.of_tree(&tree.rows, columns.len());
        let (zero, one) = (A[0][0].like(0.0), A[0][0].like(1.0));
        let mut nothing = [zero; BASE];
        let b = &mut b[tree.velocities.clone()];
        let (base, joints) = split_base(b, &mut nothing, tree.is_free);
        let joints = &mut joints[..n];
        let mut is_positive = zero.lt(one);
        let mut end = own_rows.last().map_or(0, |row| row.end);
        for j in (0..n).rev() {
            let start = own_rows[j].start;
            let columns = &columns[start..end];
            let last = columns.len() - 1;
            let (l_above, l) = lower.1[..end].split_at_mut(start);
            let (u_above, u) = upper.1[..end].split_at_mut(start);
            let (l, u) = (&mut l[..=last], &u[..=last]);
            let (l_base_above, l_base) = lower.0.split_at_mut(j);
            let (u_base_above, u_base) = upper.0.split_at_mut(j);
            let (l_base, u_base) = (l_base[0], u_base[0]);
            end = start;
            is_positive = is_positive & l[last].gt(zero);
            let inverse = one / l[last];
            let value = joints[j] * inverse;
            subtract(base, value, &u_base);
            for p in (0..last).rev() {
                let ancestor = columns[p];
                let (of_l, of_u) = (u[p] * inverse, l[p] * inverse);
                joints[ancestor] -= u[p] * value;
                subtract(&mut l_base_above[ancestor], of_l, &l_base);
                subtract(&mut u_base_above[ancestor], of_u, &u_base);
                let row = own_rows[ancestor].start;
                let (l_row, u_row) = (&mut l_above[row..][..=p], &mut u_above[row..][..=p]);
                for i in 0..p {
                    l_row[i] -= of_l * l[i];
                    u_row[i] -= of_u * u[i];
                }
                l_row[p] -= of_l * l[p];
            }
            for i in 0..BASE {
                subtract(&mut A[i], u_base[i] * inverse, &l_base);
            }
            l[last] = inverse;
        }
        is_positive = is_positive & solve_base(&mut A, base);
        for j in 0..n {
            let (start, last) = (own_rows[j].start, own_rows[j].end - 1);
            let mut rest = joints[j];
            for i in 0..BASE {
                rest -= lower.0[j][i] * base[i];
            }
            for p in start..last {
                rest -= lower.1[p] * joints[columns[p]];
            }
            joints[j] = rest * lower.1[last];
        }
        is_positive
    }
}

/// `A x` (nv) of the matrix with a lower triangle and a transposed upper one.
#[inline(always)]
pub(super) fn product<T: Lane>(
    mechanism: &Mechanism,
    [lower, upper]: [&PathFactor<T>; 2],
    x: &[T],
    out: &mut [T],
) {
    let columns = &mechanism.columns[..];
    let (lower_joints, upper_joints) = (
        &lower.joints[..columns.len()],
        &upper.joints[..columns.len()],
    );
    for (t, tree) in mechanism.trees.iter().enumerate() {
        let (n, own, lead) = (tree.rows.len(), tree.velocities.clone(), tree.lead());
        let rows = &mechanism.rows[tree.rows.clone()][..n];
        let lower_base = &lower.base[tree.rows.clone()][..n];
        let upper_base = &upper.base[tree.rows.clone()][..n];
        let (x_base, x) = x[own.clone()].split_at(lead);
        let (out_base, out) = out[own].split_at_mut(lead);
        let (x, out) = (&x[..n], &mut out[..n]);
        let zero = lower.blocks[t][0].like(0.0);
        let (mut known, mut sum) = ([zero; BASE], [zero; BASE]);
        known[..lead].copy_from_slice(x_base);
        for i in 0..BASE {
            for j in 0..i {
                sum[i] += lower.blocks[t][at(i, j)] * known[j];
                sum[j] += upper.blocks[t][at(i, j)] * known[i];
            }
            sum[i] += lower.blocks[t][at(i, i)] * known[i];
        }
        for j in 0..n {
            let (start, last) = (rows[j].start, rows[j].end - 1);
            let (value, columns) = (x[j], &columns[start..last]);
            let n = columns.len();
            let (below, above) = (
                &lower_joints[start..=last][..=n],
                &upper_joints[start..][..n],
            );
            let mut own = below[n] * value;
            for i in 0..BASE {
                own += lower_base[j][i] * known[i];
                sum[i] += upper_base[j][i] * value;
            }
            for p in 0..n {
                own += below[p] * x[columns[p]];
                out[columns[p]] += above[p] * value;
            }
            out[j] = own;
        }
        out_base.copy_from_slice(&sum[..lead]);
    }
}

/// Rows of a base's block from the lower triangle and the transposed upper one.
#[inline(always)]
fn square<T: Lane>(lower: &[T; at(BASE, 0)], upper: &[T; at(BASE, 0)]) -> [[T; BASE]; BASE] {
    let mut A = [[lower[0]; BASE]; BASE];
    for i in 0..BASE {
        for j in 0..i {
            A[i][j] = lower[at(i, j)];
            A[j][i] = upper[at(i, j)];
        }
        A[i][i] = lower[at(i, i)];
    }
    A
}

/// Solves `A x = b` in place of b. Returns where all pivots are positive.
#[inline(always)]
fn solve_base<T: Lane>(A: &mut [[T; BASE]; BASE], b: &mut [T; BASE]) -> T::Mask {
    let (zero, one) = (b[0].like(0.0), b[0].like(1.0));
    let mut is_positive = zero.lt(one);
    for k in (0..BASE).rev() {
        let own = A[k];
        is_positive = is_positive & own[k].gt(zero);
        let inverse = one / own[k];
        for i in 0..k {
            let a = A[i][k] * inverse;
            for j in 0..k {
                A[i][j] -= a * own[j];
            }
            b[i] -= a * b[k];
        }
        A[k][k] = inverse;
    }
    for k in 0..BASE {
        let mut rest = b[k];
        for j in 0..k {
            rest -= A[k][j] * b[j];
        }
        b[k] = rest * A[k][k];
    }
    is_positive
}
