//! One sweep of nonsmooth Gauss–Seidel: solves contact after contact exactly, with all others
//! fixed.
//!
//! It costs no more than one product with `W`. Stages sweep the problem itself, or the regularised
//! one to break a cycle of Newton's method.

use super::one_contact::solve_one_contact;
use crate::problem::{BlockSparseDelassus, Operator, Prepared, Proximal, dot};

/// One sweep over all contacts of the problem with `W + α I` and `q − α c`.
pub(in crate::solver) fn sweep<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    p: &mut [f64],
) {
    match data.W {
        Operator::Dense(W) => sweep_rows::<D>(data, W, prox, p),
        Operator::BlockSparse(W) => sweep_blocks::<D>(data, W, prox, p),
    }
}

/// Replaces the impulse of contact `i` by the exact solution for its current velocity `u`.
#[inline]
fn update<const D: usize>(
    mut block: [[f64; D]; D],
    u: [f64; D],
    prox: Proximal<'_>,
    offset: usize,
    mu: f64,
    p: &mut [f64],
) {
    let mut q = u;
    for r in 0..D {
        q[r] -= prox.alpha * prox.centre[offset + r];
        for c in 0..D {
            q[r] -= block[r][c] * p[offset + c];
        }
        block[r][r] += prox.alpha;
    }
    let solved = solve_one_contact(&block, &q, mu).impulse;
    if solved.iter().all(|x| x.is_finite()) {
        p[offset..offset + D].copy_from_slice(&solved);
    }
}

fn sweep_rows<const D: usize>(data: &Prepared<'_>, W: &[f64], prox: Proximal<'_>, p: &mut [f64]) {
    let n = data.n;
    for (i, &mu) in data.mu.iter().enumerate() {
        let offset = D * i;
        let u: [f64; D] = std::array::from_fn(|r| {
            dot(&W[(offset + r) * n..(offset + r + 1) * n], p) + data.q[offset + r]
        });
        update::<D>(data.block(i), u, prox, offset, mu, p);
    }
}

fn sweep_blocks<const D: usize>(
    data: &Prepared<'_>,
    W: &BlockSparseDelassus,
    prox: Proximal<'_>,
    p: &mut [f64],
) {
    for (i, &mu) in data.mu.iter().enumerate() {
        let offset = D * i;
        let mut u = W.row_times::<D>(i, p);
        for r in 0..D {
            u[r] += data.q[offset + r];
        }
        update::<D>(data.block(i), u, prox, offset, mu, p);
    }
}
