//! Nonsmooth Gauss–Seidel: solves contact after contact exactly, with all others fixed.
//!
//! Source: Jean 1999; Acary and Brogliato 2008, ch. 13. Converges linearly, and very slowly for
//! redundant contacts with large mass ratios. A sweep costs no more than one product with `W`.

use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::problem::{Proximal, Residual};
use crate::scalar::elementary::ln;
use crate::solver::local::sweep;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};
use crate::solver::work::SweepBudget;

/// Sweeps until converged or out of budget, under Coulomb's law. `u` is `W p + q` on return.
pub(in crate::solver) fn sweeps<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    budget: SweepBudget,
) -> StageEnd {
    let data = attempt.data;
    sweeps_under(attempt, &|i| Coulomb(data.mu[i]), budget)
}

/// [`sweeps`] under the law that contact i has.
pub(in crate::solver) fn sweeps_under<const D: usize, L: FrictionLaw<D>>(
    attempt: &mut Attempt<'_, D>,
    law: &impl Fn(usize) -> L,
    budget: SweepBudget,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    let mut done = 0;
    let mut last = f64::INFINITY;
    let mut best = Residual::UNSOLVED;
    let status = loop {
        attempt.find_velocity();
        let residual = data.measure_under::<D, _>(law, attempt.p, attempt.u);
        attempt.scratch.history.note(attempt.iterations, residual);
        attempt.keep_if_better(residual, &mut best);
        if options.accepts(residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        if residual.relative < 1e-7
            && residual.relative > 0.5 * last
            && data.is_within_rounding_under::<D, _>(law, attempt.p, attempt.u)
        {
            return (SolveStatus::Converged, residual);
        }
        if done >= budget.sweeps {
            break SolveStatus::MaxIterations;
        }
        // The residual costs as much as a sweep: compute it often at first, then every tenth sweep.
        let batch = (done / 2).clamp(1, 10).min(budget.sweeps - done);
        if budget.predict && done >= 20 {
            let rate = ln(residual.relative / last) / batch as f64;
            let remaining = ln(options.tolerance / residual.relative) / rate;
            if rate >= 0.0 || remaining > (budget.sweeps - done) as f64 {
                break SolveStatus::Stalled;
            }
        }
        if !attempt.affords_sweeps(1, batch) {
            break SolveStatus::BudgetExhausted;
        }
        last = residual.relative;
        let prox = Proximal {
            alpha: 0.0,
            centre: &attempt.scratch.start,
        };
        for _ in 0..batch {
            sweep::sweep_under::<D, _>(data, law, prox, attempt.p);
        }
        done += batch;
        attempt.iterations += batch;
    };
    attempt.take_best();
    (status, best)
}
