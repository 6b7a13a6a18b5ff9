//! Nonsmooth Gauss–Seidel: contact after contact is solved exactly with the others held.
//!
//! Source: Jean 1999; Acary and Brogliato 2008, ch. 13. Converges linearly, and hardly at all for redundant contacts with
//! large mass ratios; a sweep costs no more than one product with `W`.

use super::modes::Proximal;
use super::one_contact::solve_one_contact;
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, auto::Prepared};
use crate::problem::{Residual, dot, multiply_add};

/// One sweep over all contacts of the problem with `W + α I` and `q − α c`.
pub(super) fn sweep<const D: usize>(data: &Prepared<'_>, prox: Proximal<'_>, p: &mut [f64]) {
    let n = data.n;
    for (i, &mu) in data.mu.iter().enumerate() {
        let offset = D * i;
        let rows = &data.W[offset * n..(offset + D) * n];
        let mut block = [[0.0; D]; D];
        let mut own = [0.0; D];
        own.copy_from_slice(&p[offset..offset + D]);
        for r in 0..D {
            block[r].copy_from_slice(&rows[r * n + offset..r * n + offset + D]);
        }
        let mut q = [0.0; D];
        for r in 0..D {
            q[r] = dot(&rows[r * n..(r + 1) * n], p) + data.q[offset + r]
                - prox.alpha * prox.centre[offset + r];
            for c in 0..D {
                q[r] -= block[r][c] * own[c];
            }
            if r == 0 && q[0] >= 0.0 {
                break;
            }
        }
        for r in 0..D {
            block[r][r] += prox.alpha;
        }
        let solved = solve_one_contact(&block, &q, mu).impulse;
        if solved.iter().all(|x| x.is_finite()) {
            p[offset..offset + D].copy_from_slice(&solved);
        }
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
    let prox = Proximal {
        alpha: 0.0,
        centre: &workspace.start,
    };
    let mut done = 0;
    let mut last = f64::INFINITY;
    loop {
        multiply_add(data.W, p, data.q, u);
        let residual = data.measure::<D>(&workspace.rho, p, u);
        if Prepared::accepts(options, residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        if residual.relative < 1e-7
            && residual.relative > 0.5 * last
            && data.is_within_rounding::<D>(&workspace.rho, p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        if done >= budget.sweeps {
            return (SolveStatus::MaxIterations, residual);
        }
        // The measure costs a sweep: look often at first, then every tenth sweep.
        let batch = (done / 2).clamp(1, 10).min(budget.sweeps - done);
        if budget.predict && done >= 20 {
            let rate = (residual.relative / last).ln() / batch as f64;
            let remaining = (options.tolerance / residual.relative).ln() / rate;
            if rate >= 0.0 || remaining > (budget.sweeps - done) as f64 {
                return (SolveStatus::Stalled, residual);
            }
        }
        last = residual.relative;
        for _ in 0..batch {
            sweep::<D>(data, prox, p);
        }
        done += batch;
        *iterations += batch;
    }
}
