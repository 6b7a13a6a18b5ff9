//! Sparse LU of the Newton system of many contacts, on `D × D` blocks.
//!
//! The pattern is the coupling of contacts in `W`. Minimum-degree ordering keeps the fill-in of
//! heaps small (Tinney and Walker 1967). Order and pattern depend on `W` alone and are computed
//! once per solve. The numerical factorisation runs row by row and pivots only within a diagonal
//! block; one step of iterative refinement makes up for the missing pivoting between blocks.
//!
//! Every contact keeps its full `D × D` block: unknowns that its mode eliminates become rows of the
//! identity.

use std::collections::BTreeSet;

use crate::law::mode::{ContactMode, Mode};
use crate::problem::BlockSparseDelassus;
use crate::solver::local::modes::n_unknowns;

/// Pattern and numbers of a factorisation, kept between solves for their memory.
#[derive(Clone, Debug, Default)]
pub(super) struct BlockLu {
    /// Contact of each pivot, and pivot of each contact.
    order: Vec<usize>,
    position: Vec<usize>,
    /// Columns right of the diagonal, per pivot row, ascending; and left of it.
    upper: Pattern,
    lower: Pattern,
    /// Blocks of the factors: `L` with unit diagonal, `U` without its diagonal, inverse diagonal.
    upper_blocks: Vec<f64>,
    lower_blocks: Vec<f64>,
    inverse_diagonal: Vec<f64>,
    /// Whether a pivot has any unknowns.
    active: Vec<bool>,
    /// One row while it is eliminated.
    row: Vec<f64>,
    /// Matrix of the reduced system, in the layout of `W`.
    matrix: Vec<f64>,
    /// Right-hand side and residual of the refinement.
    rhs: Vec<f64>,
    correction: Vec<f64>,
}

/// Lists of columns, one per row.
#[derive(Clone, Debug, Default)]
struct Pattern {
    starts: Vec<usize>,
    columns: Vec<usize>,
}

impl Pattern {
    fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }
}

type Block<const D: usize> = [[f64; D]; D];

#[inline]
fn read<const D: usize>(blocks: &[f64], at: usize) -> Block<D> {
    let flat = &blocks[D * D * at..D * D * (at + 1)];
    std::array::from_fn(|r| std::array::from_fn(|c| flat[D * r + c]))
}

#[inline]
fn write<const D: usize>(blocks: &mut [f64], at: usize, block: &Block<D>) {
    let flat = &mut blocks[D * D * at..D * D * (at + 1)];
    for (out, row) in flat.chunks_exact_mut(D).zip(block) {
        out.copy_from_slice(row);
    }
}

#[inline]
fn product<const D: usize>(a: &Block<D>, b: &Block<D>) -> Block<D> {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..D).map(|k| a[r][k] * b[k][c]).sum()))
}

/// `out -= A B` of one block.
#[inline]
fn subtract_block<const D: usize>(a: &Block<D>, b: &[f64], out: &mut [f64]) {
    // Lengths that the compiler knows.
    let (b, out) = (&b[..D * D], &mut out[..D * D]);
    for r in 0..D {
        for c in 0..D {
            let mut sum = 0.0;
            for m in 0..D {
                sum += a[r][m] * b[D * m + c];
            }
            out[D * r + c] -= sum;
        }
    }
}

/// `out -= A x` of one block.
#[inline]
fn subtract_product<const D: usize>(block: &[f64], x: &[f64; D], out: &mut [f64; D]) {
    let block = &block[..D * D];
    for r in 0..D {
        for k in 0..D {
            out[r] -= block[D * r + k] * x[k];
        }
    }
}

/// Inverse by elimination with row exchanges; `None` for a singular block.
fn inverse<const D: usize>(mut a: Block<D>) -> Option<Block<D>> {
    let mut b: Block<D> = std::array::from_fn(|r| std::array::from_fn(|c| f64::from(r == c)));
    for k in 0..D {
        let best = (k..D).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        a.swap(k, best);
        b.swap(k, best);
        let pivot = 1.0 / a[k][k];
        if !pivot.is_finite() {
            return None;
        }
        for c in 0..D {
            a[k][c] *= pivot;
            b[k][c] *= pivot;
        }
        for r in 0..D {
            if r != k {
                let factor = a[r][k];
                for c in 0..D {
                    a[r][c] -= factor * a[k][c];
                    b[r][c] -= factor * b[k][c];
                }
            }
        }
    }
    Some(b)
}

/// `Bᵀ W C` of one block: the rows that contact `i` keeps, the columns that
/// the unknowns of contact `j` act through.
#[inline]
fn reduce<const D: usize>(
    W: &[f64],
    i: &Mode<f64>,
    j: &Mode<f64>,
    mu_i: f64,
    mu_j: f64,
) -> Block<D> {
    let mut rows: Block<D> = std::array::from_fn(|r| std::array::from_fn(|c| W[D * r + c]));
    match i.kind() {
        ContactMode::Open => return [[0.0; D]; D],
        ContactMode::Stick => {}
        ContactMode::Slip => {
            let [e0, e1] = i.direction();
            if D == 3 && mu_i > 0.0 {
                rows[1] = std::array::from_fn(|c| e0 * rows[D - 1][c] - e1 * rows[1][c]);
                rows[D - 1] = [0.0; D];
            } else {
                for row in &mut rows[1..] {
                    *row = [0.0; D];
                }
            }
        }
    }
    match j.kind() {
        ContactMode::Open => return [[0.0; D]; D],
        ContactMode::Stick => {}
        ContactMode::Slip => {
            let [e0, e1] = j.direction();
            for row in &mut rows {
                let along = row[1] * e0 + row[D - 1] * e1;
                let turning = e0 * row[D - 1] - e1 * row[1];
                row[0] += mu_j * along;
                for x in &mut row[1..] {
                    *x = 0.0;
                }
                if D == 3 && mu_j > 0.0 {
                    row[1] = turning;
                }
            }
        }
    }
    rows
}

impl BlockLu {
    /// Order of elimination and pattern of the factors of `W`.
    pub fn analyse(&mut self, W: &BlockSparseDelassus) {
        let n = W.n_contacts();
        // Both triangles, since the pattern of W need not be symmetric.
        let mut adjacent: Vec<Vec<usize>> = vec![Vec::new(); n];
        for i in 0..n {
            for &j in W.neighbours(i).iter().filter(|&&j| j != i) {
                adjacent[i].push(j);
                adjacent[j].push(i);
            }
        }
        for list in &mut adjacent {
            list.sort_unstable();
            list.dedup();
        }
        let mut queue: BTreeSet<(usize, usize)> = (0..n).map(|i| (adjacent[i].len(), i)).collect();
        self.order.clear();
        self.position.clear();
        self.position.resize(n, 0);
        while let Some((_, i)) = queue.pop_first() {
            self.position[i] = self.order.len();
            self.order.push(i);
            let clique = std::mem::take(&mut adjacent[i]);
            for &j in &clique {
                let old = std::mem::take(&mut adjacent[j]);
                queue.remove(&(old.len(), j));
                let merged = merge(&old, &clique, [i, j]);
                queue.insert((merged.len(), j));
                adjacent[j] = merged;
            }
            adjacent[i] = clique;
        }
        for pattern in [&mut self.upper, &mut self.lower] {
            pattern.starts.clear();
            pattern.columns.clear();
            pattern.starts.push(0);
        }
        let mut left: Vec<Vec<usize>> = vec![Vec::new(); n];
        for (k, &i) in self.order.iter().enumerate() {
            let start = self.upper.columns.len();
            let positions = adjacent[i].iter().map(|&j| self.position[j]);
            self.upper.columns.extend(positions);
            self.upper.columns[start..].sort_unstable();
            for &j in &self.upper.columns[start..] {
                left[j].push(k);
            }
            self.upper.starts.push(self.upper.columns.len());
        }
        for list in left {
            self.lower.columns.extend(list);
            self.lower.starts.push(self.lower.columns.len());
        }
        let size = W.components() * W.components();
        self.upper_blocks
            .resize(size * self.upper.columns.len(), 0.0);
        self.lower_blocks
            .resize(size * self.lower.columns.len(), 0.0);
        self.inverse_diagonal.resize(size * n, 0.0);
        self.active.resize(n, false);
        self.row.resize(size * n, 0.0);
        self.matrix.resize(size * W.n_blocks(), 0.0);
        self.rhs.resize(W.components() * n, 0.0);
        self.correction.resize(W.components() * n, 0.0);
    }

    /// Work of a factorisation with the analysed pattern, and of the step that uses it.
    pub fn work(&self) -> u64 {
        let d = if self.order.is_empty() {
            0
        } else {
            self.rhs.len() / self.order.len()
        };
        let rows = (0..self.order.len()).map(|k| self.upper.row(k).len());
        let products: usize = rows.map(|columns| columns * (columns + 4)).sum();
        let blocks = self.matrix.len() / (d * d).max(1);
        (d * d * d * products + 4 * d * d * (blocks + self.order.len())) as u64
    }

    /// Builds and factors `Bᵀ (W + α I) C + γ` of the predicted modes, or with a block of each
    /// contact in the place of `α I`. `false` at a singular pivot.
    pub fn factorise<const D: usize>(
        &mut self,
        W: &BlockSparseDelassus,
        mu: &[f64],
        alpha: f64,
        blocks: Option<&[f64]>,
        modes: &[Mode<f64>],
    ) -> bool {
        for (i, mode) in modes.iter().enumerate() {
            let kind = mode.kind();
            let first = W.row_start(i);
            for (k, (&j, block)) in W
                .neighbours(i)
                .iter()
                .zip(W.row(i).chunks_exact(D * D))
                .enumerate()
            {
                let mut reduced = reduce::<D>(block, mode, &modes[j], mu[i], mu[j]);
                if i == j {
                    let size = n_unknowns::<D>(kind, mu[i]);
                    for r in 0..D {
                        reduced[r][r] = if r < size { reduced[r][r] + alpha } else { 1.0 };
                    }
                    if let Some(blocks) = blocks {
                        let own = read::<D>(blocks, i);
                        for r in 0..D {
                            for c in 0..D {
                                reduced[r][c] += own[r][c];
                            }
                        }
                    }
                    if size == 2 && kind == ContactMode::Slip {
                        reduced[1][1] += mode.gamma;
                    }
                }
                write(&mut self.matrix, first + k, &reduced);
            }
            self.active[self.position[i]] = kind != ContactMode::Open;
        }
        (0..self.order.len()).all(|k| self.eliminate_row::<D>(W, k))
    }

    fn eliminate_row<const D: usize>(&mut self, W: &BlockSparseDelassus, k: usize) -> bool {
        let zero = [[0.0; D]; D];
        let i = self.order[k];
        for at in self.lower.row(k) {
            write(&mut self.row, self.lower.columns[at], &zero);
        }
        for at in self.upper.row(k) {
            write(&mut self.row, self.upper.columns[at], &zero);
        }
        for (at, &j) in (W.row_start(i)..).zip(W.neighbours(i)) {
            let block = read::<D>(&self.matrix, at);
            write(&mut self.row, self.position[j], &block);
        }
        for at in self.lower.row(k) {
            let column = self.lower.columns[at];
            if !(self.active[column] && self.active[k]) {
                write(&mut self.lower_blocks, at, &zero);
                continue;
            }
            let factor = product::<D>(
                &read(&self.row, column),
                &read(&self.inverse_diagonal, column),
            );
            write(&mut self.lower_blocks, at, &factor);
            for up in self.upper.row(column) {
                let target = self.upper.columns[up];
                let out = &mut self.row[D * D * target..D * D * (target + 1)];
                let block = &self.upper_blocks[D * D * up..D * D * (up + 1)];
                subtract_block(&factor, block, out);
            }
        }
        for at in self.upper.row(k) {
            let block = read::<D>(&self.row, self.upper.columns[at]);
            write(&mut self.upper_blocks, at, &block);
        }
        let Some(inverse) = inverse::<D>(read(&self.row, k)) else {
            return false;
        };
        write(&mut self.inverse_diagonal, k, &inverse);
        true
    }

    /// Solves the factored system in place of `b` (`n`, contact by
    /// contact), with one step of refinement.
    pub fn solve<const D: usize>(&mut self, W: &BlockSparseDelassus, b: &mut [f64]) {
        let mut rhs = std::mem::take(&mut self.rhs);
        let mut correction = std::mem::take(&mut self.correction);
        rhs.copy_from_slice(b);
        self.substitute::<D>(&rhs, b);
        for (i, r) in rhs.chunks_exact_mut(D).enumerate() {
            let mut sum: [f64; D] = std::array::from_fn(|k| r[k]);
            for (at, &j) in (W.row_start(i)..).zip(W.neighbours(i)) {
                let x = std::array::from_fn(|k| b[D * j + k]);
                subtract_product(&self.matrix[D * D * at..D * D * (at + 1)], &x, &mut sum);
            }
            r.copy_from_slice(&sum);
        }
        self.substitute::<D>(&rhs, &mut correction);
        for (x, c) in b.iter_mut().zip(&correction) {
            *x += c;
        }
        (self.rhs, self.correction) = (rhs, correction);
    }

    /// `out = (LU)⁻¹ b`; uses the elimination row as scratch.
    fn substitute<const D: usize>(&mut self, b: &[f64], out: &mut [f64]) {
        let x = &mut self.row[..D * self.order.len()];
        for (k, &i) in self.order.iter().enumerate() {
            let mut sum: [f64; D] = std::array::from_fn(|r| b[D * i + r]);
            for at in self.lower.row(k) {
                let j = self.lower.columns[at];
                let other = std::array::from_fn(|r| x[D * j + r]);
                subtract_product(
                    &self.lower_blocks[D * D * at..D * D * (at + 1)],
                    &other,
                    &mut sum,
                );
            }
            x[D * k..D * (k + 1)].copy_from_slice(&sum);
        }
        for (k, &i) in self.order.iter().enumerate().rev() {
            let mut sum: [f64; D] = std::array::from_fn(|r| x[D * k + r]);
            for at in self.upper.row(k) {
                let j = self.upper.columns[at];
                let other = std::array::from_fn(|r| x[D * j + r]);
                subtract_product(
                    &self.upper_blocks[D * D * at..D * D * (at + 1)],
                    &other,
                    &mut sum,
                );
            }
            let inverse = read::<D>(&self.inverse_diagonal, k);
            for r in 0..D {
                let value = (0..D).map(|c| inverse[r][c] * sum[c]).sum();
                x[D * k + r] = value;
                out[D * i + r] = value;
            }
        }
    }
}

/// Union of two ascending lists without the two given numbers.
fn merge(a: &[usize], b: &[usize], without: [usize; 2]) -> Vec<usize> {
    let mut out = Vec::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (Some(&&x), Some(&&y)) => {
                if x <= y {
                    a.next();
                }
                if y <= x {
                    b.next();
                }
                x.min(y)
            }
            (Some(&&x), None) => {
                a.next();
                x
            }
            (None, Some(&&y)) => {
                b.next();
                y
            }
            (None, None) => return out,
        };
        if !without.contains(&next) {
            out.push(next);
        }
    }
}
