//! Nonsmooth Gauss–Seidel: contact after contact is solved exactly with the others held.
//!
//! Source: Jean 1999; Acary and Brogliato 2008, ch. 13. Converges linearly, and hardly at all for redundant contacts with
//! large mass ratios; a sweep costs no more than one product with `W`.

use super::modes::Proximal;
use super::one_contact::solve_one_contact;
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, auto::Prepared};
use crate::problem::{BlockSparseDelassus, Operator, Residual, dot};

/// One sweep over all contacts of the problem with `W + α I` and `q − α c`.
pub(super) fn sweep<const D: usize>(data: &Prepared<'_>, prox: Proximal<'_>, p: &mut [f64]) {
    match data.W {
        Operator::Dense(W) => sweep_rows::<D>(data, W, prox, p),
        Operator::BlockSparse(W) => sweep_blocks::<D>(data, W, prox, p),
    }
}

/// Replaces the impulse of contact `i` by the exact answer to the velocity `u` that it sees now.
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

/// When to give up sweeping.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Most sweeps.
    pub sweeps: usize,
    /// Whether to stop as soon as the rate of the last sweeps would not reach the tolerance within the budget.
    pub predict: bool,
}

/// Sweeps until converged or out of budget. `u` is `W p + q` on return.
pub(super) fn sweeps<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    budget: Budget,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let mut done = 0;
    let mut last = f64::INFINITY;
    let mut best = Residual::UNSOLVED;
    let give_best = |status, best, p: &mut [f64], u: &mut [f64], workspace: &SolverWorkspace| {
        p.copy_from_slice(&workspace.best);
        data.W.multiply_add(p, data.q, u);
        (status, best)
    };
    loop {
        data.W.multiply_add(p, data.q, u);
        let residual = data.measure::<D>(workspace, p, u);
        if residual.relative < best.relative {
            best = residual;
            workspace.best.copy_from_slice(p);
        }
        if Prepared::accepts(options, residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        if residual.relative < 1e-7
            && residual.relative > 0.5 * last
            && data.is_within_rounding::<D>(workspace, p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        if done >= budget.sweeps {
            return give_best(SolveStatus::MaxIterations, best, p, u, workspace);
        }
        // The measure costs a sweep: look often at first, then every tenth sweep.
        let batch = (done / 2).clamp(1, 10).min(budget.sweeps - done);
        if budget.predict && done >= 20 {
            let rate = (residual.relative / last).ln() / batch as f64;
            let remaining = (options.tolerance / residual.relative).ln() / rate;
            if rate >= 0.0 || remaining > (budget.sweeps - done) as f64 {
                return give_best(SolveStatus::Stalled, best, p, u, workspace);
            }
        }
        if !workspace.affords_sweeps(data.product, data.mu.len(), batch) {
            return give_best(SolveStatus::BudgetExhausted, best, p, u, workspace);
        }
        last = residual.relative;
        let prox = Proximal {
            alpha: 0.0,
            centre: &workspace.start,
        };
        for _ in 0..batch {
            sweep::<D>(data, prox, p);
        }
        done += batch;
        *iterations += batch;
    }
}
