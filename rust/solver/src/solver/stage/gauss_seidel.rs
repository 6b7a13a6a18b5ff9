//! Nonsmooth Gauss–Seidel: solves contact after contact exactly, with all others fixed.
//!
//! Source: Jean 1999; Acary and Brogliato 2008, ch. 13. Converges linearly, and very slowly for
//! redundant contacts with large mass ratios. A sweep costs no more than one product with `W`.

use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::problem::{Prepared, Proximal, Residual};
use crate::scalar::elementary::ln;
use crate::solver::local::sweep;
use crate::solver::options::SolverOptions;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::SolveScratch;
use crate::solver::work::SweepBudget;

/// Sweeps until converged or out of budget, under Coulomb's law. `u` is `W p + q` on return.
pub(in crate::solver) fn sweeps<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    budget: SweepBudget,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let law = |i: usize| Coulomb(data.mu[i]);
    sweeps_under::<D, _>((data, &law), options, budget, p, u, scratch, iterations)
}

/// [`sweeps`] under the law that contact i has.
pub(in crate::solver) fn sweeps_under<const D: usize, L: FrictionLaw<D>>(
    (data, law): (&Prepared<'_>, &impl Fn(usize) -> L),
    options: &SolverOptions,
    budget: SweepBudget,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let mut done = 0;
    let mut last = f64::INFINITY;
    let mut best = Residual::UNSOLVED;
    let give_best = |status, best, p: &mut [f64], u: &mut [f64], scratch: &SolveScratch| {
        p.copy_from_slice(&scratch.best);
        data.W.multiply_add(p, data.q, u);
        (status, best)
    };
    loop {
        data.W.multiply_add(p, data.q, u);
        let residual = data.measure_under::<D, _>(law, p, u);
        scratch.history.note(*iterations, residual);
        if residual.relative < best.relative {
            best = residual;
            scratch.best.copy_from_slice(p);
        }
        if options.accepts(residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        if residual.relative < 1e-7
            && residual.relative > 0.5 * last
            && data.is_within_rounding_under::<D, _>(law, p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        if done >= budget.sweeps {
            return give_best(SolveStatus::MaxIterations, best, p, u, scratch);
        }
        // The residual costs as much as a sweep: compute it often at first, then every tenth sweep.
        let batch = (done / 2).clamp(1, 10).min(budget.sweeps - done);
        if budget.predict && done >= 20 {
            let rate = ln(residual.relative / last) / batch as f64;
            let remaining = ln(options.tolerance / residual.relative) / rate;
            if rate >= 0.0 || remaining > (budget.sweeps - done) as f64 {
                return give_best(SolveStatus::Stalled, best, p, u, scratch);
            }
        }
        if !scratch.affords_sweeps(data.product, data.mu.len(), batch) {
            return give_best(SolveStatus::BudgetExhausted, best, p, u, scratch);
        }
        last = residual.relative;
        let prox = Proximal {
            alpha: 0.0,
            centre: &scratch.start,
        };
        for _ in 0..batch {
            sweep::sweep_under::<D, _>(data, law, prox, p);
        }
        done += batch;
        *iterations += batch;
    }
}
