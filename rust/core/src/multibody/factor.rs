//! Factor `M = Lᵀ D L` of the mass matrix along the trees, and solves with it.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 8 (branch-induced sparsity).

use std::ops::Range;

use super::composite::BLOCK;
use super::mechanism::{BASE, Mechanism, TreeSpan};
use crate::scalar::{Lane, inlined};

/// A symmetric matrix or its factor along the paths of a mechanism; see
/// [`super::mass_matrix`].
#[derive(Debug)]
pub(super) struct PathFactor<T> {
    /// Block of each tree's base: the lower triangle by rows.
    pub blocks: Vec<[T; BLOCK]>,
    /// Entries of each row with the base of its tree.
    pub base: Vec<[T; BASE]>,
    pub joints: Vec<T>,
}

impl<T: Lane> PathFactor<T> {
    pub(super) fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            blocks: vec![[zero; BLOCK]; mechanism.trees.len()],
            base: vec![[zero; BASE]; mechanism.rows.len()],
            joints: vec![zero; mechanism.columns.len()],
        }
    }

    /// `M + a C`.
    #[inline(always)]
    pub(super) fn set_sum(&mut self, M: &Self, a: T, C: &Self) {
        let blocks = (M.blocks.as_flattened(), C.blocks.as_flattened());
        let base = (M.base.as_flattened(), C.base.as_flattened());
        for (own, (M, C)) in [
            (self.blocks.as_flattened_mut(), blocks),
            (self.base.as_flattened_mut(), base),
            (&mut self.joints[..], (&M.joints[..], &C.joints[..])),
        ] {
            for (own, (M, C)) in own.iter_mut().zip(M.iter().zip(C)) {
                *own = *M + a * *C;
            }
        }
    }

    /// Entries of a tree's rows with its base, and the first `n` of all entries with joints.
    #[inline(always)]
    pub(super) fn of_tree(
        &mut self,
        rows: &Range<usize>,
        n: usize,
    ) -> (&mut [[T; BASE]], &mut [T]) {
        (&mut self.base[rows.clone()], &mut self.joints[..n])
    }

    /// Gives a tree a base that nothing moves.
    #[cold]
    pub(super) fn fix_base(&mut self, t: usize, tree: &TreeSpan) {
        let block = &mut self.blocks[t];
        let (zero, one) = (block[0].like(0.0), block[0].like(1.0));
        *block = [zero; BLOCK];
        for k in 0..BASE {
            block[k * (k + 1) / 2 + k] = one;
        }
        self.base[tree.rows.clone()].fill([zero; BASE]);
    }
}

impl<T: Clone> Clone for PathFactor<T> {
    fn clone(&self) -> Self {
        Self {
            blocks: self.blocks.clone(),
            base: self.base.clone(),
            joints: self.joints.clone(),
        }
    }

    /// Does not allocate if the sizes agree.
    fn clone_from(&mut self, other: &Self) {
        self.blocks.clone_from(&other.blocks);
        self.base.clone_from(&other.base);
        self.joints.clone_from(&other.joints);
    }
}

/// `M = Lᵀ D L`, L unit lower triangular with M's sparsity. Holds `L` and `D^(-1/2)`.
#[derive(Clone, Debug)]
pub struct Factor<T: Lane> {
    pub(super) rows: PathFactor<T>,
    /// Entries of `D^(-1/2)` for each tree's base.
    block_roots: Vec<[T; BASE]>,
    /// Entry of `D^(-1/2)` for each row.
    roots: Vec<T>,
}

impl<T: Lane> Factor<T> {
    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            rows: PathFactor::new(token, mechanism),
            block_roots: vec![[zero; BASE]; mechanism.trees.len()],
            roots: vec![zero; mechanism.rows.len()],
        }
    }

    /// Takes a machine's factor in every lane.
    pub fn spread(&mut self, token: T::Token, other: &Factor<f64>) {
        let each = |own: &mut [T], other: &[f64]| {
            for (own, x) in own.iter_mut().zip(other) {
                *own = T::splat(token, *x);
            }
        };
        each(
            self.rows.blocks.as_flattened_mut(),
            other.rows.blocks.as_flattened(),
        );
        each(
            self.rows.base.as_flattened_mut(),
            other.rows.base.as_flattened(),
        );
        each(&mut self.rows.joints, &other.rows.joints);
        each(
            self.block_roots.as_flattened_mut(),
            other.block_roots.as_flattened(),
        );
        each(&mut self.roots, &other.roots);
    }

    /// Turns the entries of M into those of its factor.
    pub(super) fn update(&mut self, token: T::Token, mechanism: &Mechanism) -> T::Mask {
        let mut is_positive = T::mask(token, u32::MAX >> (32 - T::LANES));
        for t in 0..mechanism.trees.len() {
            // The loop is out here: in the closure, registers are moved in circles.
            let of_tree = inlined!(T::vectorize, token, self.update_tree(mechanism, t));
            is_positive = is_positive & of_tree;
        }
        is_positive
    }

    #[inline(always)]
    fn update_tree(&mut self, mechanism: &Mechanism, t: usize) -> T::Mask {
        let TreeSpan { rows: own, .. } = &mechanism.trees[t];
        let n = own.len();
        let (own_rows, columns) = (&mechanism.rows[own.clone()][..n], &mechanism.columns[..]);
        let (base_rows, roots) = (
            &mut self.rows.base[own.clone()][..n],
            &mut self.roots[own.clone()][..n],
        );
        let entries = &mut self.rows.joints[..columns.len()];
        let mut block = self.rows.blocks[t];
        let (zero, one) = (block[0].like(0.0), block[0].like(1.0));
        let mut is_positive = zero.lt(one);
        let mut end = own_rows.last().map_or(0, |row| row.end);
        for j in (0..n).rev() {
            let start = own_rows[j].start;
            let columns = &columns[start..end];
            let (above, own) = entries[..end].split_at_mut(start);
            let (base_above, base_row) = base_rows.split_at_mut(j);
            end = start;
            let last = columns.len() - 1;
            let own = &mut own[..=last];
            let base = base_row[0];
            let pivot = own[last];
            is_positive = is_positive & pivot.gt(zero);
            let inverse = one / pivot;
            roots[j] = inverse.sqrt();
            for p in (0..last).rev() {
                let a = own[p] * inverse;
                let ancestor = columns[p];
                subtract(&mut base_above[ancestor], a, &base);
                let row = &mut above[own_rows[ancestor].start..][..=p];
                for i in 0..=p {
                    row[i] -= a * own[i];
                }
                own[p] = a;
            }
            let [a, b, c, d, e, f] = base;
            let factors = [
                a * inverse,
                b * inverse,
                c * inverse,
                d * inverse,
                e * inverse,
                f * inverse,
            ];
            subtract_product(&mut block, &factors, &base);
            base_row[0] = factors;
        }
        let roots = &mut self.block_roots[t];
        is_positive = is_positive & eliminate::<T, 5>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 4>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 3>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 2>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 1>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 0>(&mut block, roots);
        self.rows.blocks[t] = block;
        is_positive
    }

    /// `y ← D^(-1/2) L^(-T) y` (nv).
    #[inline(always)]
    pub fn half_solve(&self, mechanism: &Mechanism, y: &mut [T]) {
        let (columns, entries) = (&mechanism.columns[..], &self.rows.joints[..]);
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let n = tree.rows.len();
            let own_rows = &mechanism.rows[tree.rows.clone()][..n];
            let rows = &self.rows.base[tree.rows.clone()][..n];
            let roots = &self.roots[tree.rows.clone()][..n];
            let (block, block_roots) = (&self.rows.blocks[t], &self.block_roots[t]);
            let mut nothing = [block[0].like(0.0); BASE];
            let y = &mut y[tree.velocities.clone()];
            let (base, joints) = split_base(y, &mut nothing, tree.is_free);
            let joints = &mut joints[..n];
            let mut sum = *base;
            let mut end = own_rows.last().map_or(0, |row| row.end);
            for j in (0..n).rev() {
                let start = own_rows[j].start;
                let (columns, entries) = (&columns[start..end], &entries[start..end]);
                end = start;
                let value = joints[j];
                subtract(&mut sum, value, &rows[j]);
                for p in 0..columns.len() - 1 {
                    joints[columns[p]] -= entries[p] * value;
                }
                joints[j] = value * roots[j];
            }
            for k in (0..BASE).rev() {
                let value = sum[k];
                for i in 0..k {
                    sum[i] -= block[k * (k + 1) / 2 + i] * value;
                }
                base[k] = value * block_roots[k];
            }
        }
    }

    /// `x ← L^(-1) D^(-1/2) x` (nv); after [`Self::half_solve`] the result is `M^(-1)` times the
    /// vector.
    #[inline(always)]
    pub fn half_solve_back(&self, mechanism: &Mechanism, x: &mut [T]) {
        let (columns, entries) = (&mechanism.columns[..], &self.rows.joints[..]);
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let n = tree.rows.len();
            let own_rows = &mechanism.rows[tree.rows.clone()][..n];
            let rows = &self.rows.base[tree.rows.clone()][..n];
            let roots = &self.roots[tree.rows.clone()][..n];
            let (block, block_roots) = (&self.rows.blocks[t], &self.block_roots[t]);
            let mut nothing = [block[0].like(0.0); BASE];
            let x = &mut x[tree.velocities.clone()];
            let (base, joints) = split_base(x, &mut nothing, tree.is_free);
            let joints = &mut joints[..n];
            let mut known = *base;
            for k in 0..BASE {
                let mut value = base[k] * block_roots[k];
                for i in 0..k {
                    value -= block[k * (k + 1) / 2 + i] * known[i];
                }
                known[k] = value;
                base[k] = value;
            }
            for j in 0..n {
                let mut value = joints[j] * roots[j];
                for i in 0..BASE {
                    value -= rows[j][i] * known[i];
                }
                let (start, end) = (own_rows[j].start, own_rows[j].end - 1);
                let (columns, entries) = (&columns[start..end], &entries[start..end]);
                for p in 0..columns.len() {
                    value -= entries[p] * joints[columns[p]];
                }
                joints[j] = value;
            }
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for several columns along the path of body `b`: `y` has the length
    /// of [`Mechanism::path`], and nothing else is nonzero.
    #[inline(always)]
    pub fn half_solve_path<const N: usize>(
        &self,
        mechanism: &Mechanism,
        b: usize,
        y: &mut [[T; N]],
    ) {
        let (t, columns) = (mechanism.links[b].tree, mechanism.row(b));
        let tree = &mechanism.trees[t];
        let (block, block_roots) = (&self.rows.blocks[t], &self.block_roots[t]);
        let mut nothing = [[block[0].like(0.0); N]; BASE];
        let (base, joints) = split_base(y, &mut nothing, tree.is_free);
        let mut sum = *base;
        let joints = &mut joints[..columns.len()];
        for p in (0..columns.len()).rev() {
            let j = tree.rows.start + columns[p];
            let value = joints[p];
            let row = &self.rows.base[j];
            for i in 0..BASE {
                subtract_columns(&mut sum[i], row[i], &value);
            }
            let entries = &self.rows.joints[mechanism.rows[j].start..][..p];
            for i in 0..p {
                subtract_columns(&mut joints[i], entries[i], &value);
            }
            joints[p] = scaled(&value, self.roots[j]);
        }
        for k in (0..BASE).rev() {
            let value = sum[k];
            for i in 0..k {
                subtract_columns(&mut sum[i], block[k * (k + 1) / 2 + i], &value);
            }
            base[k] = scaled(&value, block_roots[k]);
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for several columns (nv) with the given nonzero velocities:
    /// ascending, and closed under ancestors.
    pub fn half_solve_columns<const N: usize>(
        &self,
        mechanism: &Mechanism,
        velocities: impl DoubleEndedIterator<Item = usize>,
        y: &mut [[T; N]],
    ) {
        for k in velocities.rev() {
            let t = mechanism.tree_of[k];
            let tree = &mechanism.trees[t];
            let (before, own) =
                y[tree.velocities.start..=k].split_at_mut(k - tree.velocities.start);
            let (value, at) = (own[0], before.len());
            if at < tree.lead() {
                let row = &self.rows.blocks[t][at * (at + 1) / 2..][..at];
                for (y, x) in before.iter_mut().zip(row) {
                    subtract_columns(y, *x, &value);
                }
                own[0] = scaled(&value, self.block_roots[t][at]);
                continue;
            }
            let row = mechanism.row_of(k);
            let (base, joints) = before.split_at_mut(tree.lead());
            for (y, x) in base.iter_mut().zip(&self.rows.base[row]) {
                subtract_columns(y, *x, &value);
            }
            let entries = mechanism.rows[row].start..mechanism.rows[row].end - 1;
            let columns = &mechanism.columns[entries.clone()];
            for (&j, x) in columns.iter().zip(&self.rows.joints[entries]) {
                subtract_columns(&mut joints[j], *x, &value);
            }
            own[0] = scaled(&value, self.roots[row]);
        }
    }
}

/// The entries with the base of a tree, and all others. A tree without one has `nothing`.
#[inline(always)]
pub(super) fn split_base<'a, T>(
    y: &'a mut [T],
    nothing: &'a mut [T; BASE],
    is_free: bool,
) -> (&'a mut [T; BASE], &'a mut [T]) {
    if !is_free {
        return (nothing, y);
    }
    match y.split_first_chunk_mut() {
        Some(parts) => parts,
        None => unreachable!("invariant: a free root has six velocities"),
    }
}

/// `x −= a y`.
#[inline(always)]
pub(super) fn subtract<T: Lane>(x: &mut [T; BASE], a: T, y: &[T; BASE]) {
    for i in 0..BASE {
        x[i] -= a * y[i];
    }
}

/// `x −= a y` for several columns.
#[inline(always)]
fn subtract_columns<T: Lane, const N: usize>(x: &mut [T; N], a: T, y: &[T; N]) {
    for c in 0..N {
        x[c] -= a * y[c];
    }
}

/// `a y`.
#[inline(always)]
fn scaled<T: Lane, const N: usize>(y: &[T; N], a: T) -> [T; N] {
    let mut product = *y;
    for c in 0..N {
        product[c] *= a;
    }
    product
}

/// Eliminates velocity K of the base, when all after it are. Returns where its pivot is positive. K
/// is a constant so that the block stays in registers.
#[inline(always)]
fn eliminate<T: Lane, const K: usize>(block: &mut [T; BLOCK], roots: &mut [T; BASE]) -> T::Mask {
    let start = K * (K + 1) / 2;
    let pivot = block[start + K];
    let inverse = pivot.like(1.0) / pivot;
    roots[K] = inverse.sqrt();
    for p in (0..K).rev() {
        let a = block[start + p] * inverse;
        for i in 0..=p {
            block[p * (p + 1) / 2 + i] -= a * block[start + i];
        }
        block[start + p] = a;
    }
    pivot.gt(pivot.like(0.0))
}

/// `A −= a yᵀ`, where the product is symmetric; the lower triangle by its rows.
#[inline(always)]
fn subtract_product<T: Lane>(A: &mut [T; BLOCK], a: &[T; BASE], y: &[T; BASE]) {
    for i in 0..BASE {
        for k in 0..=i {
            A[i * (i + 1) / 2 + k] -= a[i] * y[k];
        }
    }
}
