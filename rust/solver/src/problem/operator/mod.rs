//! The Delassus operator `W`, with the few products that a solver needs.
//!
//! [`Operator`] is `W` in either storage, dense or [block-sparse](BlockSparseDelassus).
//! [`BodyPairs`] serves very many free bodies: it works with the contacts themselves and never
//! forms `W`.

mod block_sparse;
mod body_pairs;
mod dense;
mod storage;

pub use block_sparse::{BlockSparseDelassus, PairContact};
pub use body_pairs::{BodyPairs, RoundPair};
pub(crate) use dense::dot;
pub(crate) use storage::Storage;

use super::Dimension;
use dense::multiply_add;

/// The Delassus operator `W` of a problem, borrowed.
#[derive(Clone, Copy, Debug)]
pub enum Operator<'a> {
    /// Row-major `n × n`, 1/kg.
    Dense(&'a [f64]),
    /// Blocks of the contacts that share a body.
    BlockSparse(&'a BlockSparseDelassus),
}

impl Operator<'_> {
    /// `out = W x + b`, all of length `n`.
    #[inline]
    pub fn multiply_add(self, x: &[f64], b: &[f64], out: &mut [f64]) {
        match self {
            Self::Dense(W) => multiply_add(W, x, b, out),
            Self::BlockSparse(W) => W.multiply_add(x, b, out),
        }
    }

    /// Work of one product with `W`, including the residual of its contacts, in multiply–adds.
    pub(crate) fn product_work(self, n: usize) -> u64 {
        let entries = match self {
            Self::Dense(_) => n * n,
            Self::BlockSparse(W) => W.components().pow(2) * W.n_blocks(),
        };
        (entries + 20 * n) as u64
    }

    /// Diagonal block of contact `i`, 1/kg; `n` unknowns in all.
    #[inline]
    pub(crate) fn block<const D: usize>(self, n: usize, i: usize) -> [[f64; D]; D] {
        let mut block = [[0.0; D]; D];
        match self {
            Self::Dense(W) => {
                for (r, row) in block.iter_mut().enumerate() {
                    let start = (D * i + r) * n + D * i;
                    row.copy_from_slice(&W[start..start + D]);
                }
            }
            Self::BlockSparse(W) => {
                for (row, stored) in block.iter_mut().zip(W.diagonal_block(i).chunks_exact(D)) {
                    row.copy_from_slice(stored);
                }
            }
        }
        block
    }

    /// Entry `k` of the diagonal of contact `i`'s block, 1/kg.
    #[inline]
    pub(crate) fn diagonal(self, dimension: Dimension, n: usize, i: usize, k: usize) -> f64 {
        let d = dimension.components();
        match self {
            Self::Dense(W) => W[(d * i + k) * (n + 1)],
            Self::BlockSparse(W) => W.diagonal_block(i)[k * (d + 1)],
        }
    }

    /// `Σ_c |W_rc x_c|` of row `r`: the reference for the rounding of that row.
    pub(crate) fn row_magnitude(self, r: usize, x: &[f64]) -> f64 {
        match self {
            Self::Dense(W) => {
                let row = &W[r * x.len()..(r + 1) * x.len()];
                row.iter().zip(x).map(|(w, x)| (w * x).abs()).sum()
            }
            Self::BlockSparse(W) => {
                let d = W.components();
                let (i, k) = (r / d, r % d);
                let blocks = W.row(i).chunks_exact(d * d);
                W.neighbours(i)
                    .iter()
                    .zip(blocks)
                    .map(|(&j, block)| {
                        let terms = block[k * d..(k + 1) * d].iter().zip(&x[d * j..]);
                        terms.map(|(w, x)| (w * x).abs()).sum::<f64>()
                    })
                    .sum()
            }
        }
    }

    /// Whether no contact has an entry with another one. Costs one look where the first two have.
    pub(crate) fn is_uncoupled<const D: usize>(self, n: usize) -> bool {
        match self {
            Self::Dense(W) => W.chunks_exact(n).enumerate().all(|(r, row)| {
                let own = D * (r / D);
                let others = row[..own].iter().chain(&row[own + D..]);
                others.into_iter().all(|w| *w == 0.0)
            }),
            Self::BlockSparse(W) => W.n_blocks() == W.n_contacts(),
        }
    }

    /// First entry that is not finite: row, column, value.
    pub(crate) fn first_non_finite(self, n: usize) -> Option<(usize, usize, f64)> {
        match self {
            Self::Dense(W) => {
                let at = W.iter().position(|x| !x.is_finite())?;
                Some((at / n, at % n, W[at]))
            }
            Self::BlockSparse(W) => {
                let d = W.components();
                (0..W.n_contacts()).find_map(|i| {
                    let at = W.row(i).iter().position(|x| !x.is_finite())?;
                    let (j, inner) = (W.neighbours(i)[at / (d * d)], at % (d * d));
                    Some((d * i + inner / d, d * j + inner % d, W.row(i)[at]))
                })
            }
        }
    }
}
