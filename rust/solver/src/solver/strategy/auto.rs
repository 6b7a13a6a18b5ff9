//! [`Method::Auto`]: cheap stages first, robust ones last. The table of the
//! [chapter](crate::solver) gives the reason for each rung.

use super::islands::{self, IslandSolver};
use crate::problem::{Operator, Prepared, Residual};
use crate::solver::options::{Method, SolverOptions};
use crate::solver::report::{SolveStatus, Stage, StageResult};
use crate::solver::scratch::SolveScratch;
use crate::solver::stage::{
    gauss_seidel, guided, interior_point, newton, pivoting, proximal, restarts,
};
use crate::solver::work::SweepBudget;

/// Most sweeps over many contacts before Newton. A dense Newton step costs about as much as `n`
/// sweeps; the fill-in of a block-sparse one grows with the problem. Chosen among 20, 50 and 200 on
/// the recorded problems.
fn sweep_budget(data: &Prepared<'_>) -> usize {
    match data.W {
        Operator::Dense(_) => 2 * data.n,
        Operator::BlockSparse(_) => (data.mu.len() / 20).max(50),
    }
}

/// Newton steps of a short attempt with the proximal point method.
const ATTEMPT: usize = 100;

/// Attempts to pivot at random after the first attempt with the proximal point method, and after
/// each other.
const FEW_AT_RANDOM: usize = 3;
const AT_RANDOM: usize = 6;

/// Residual below which few contacts get a second proximal point run, from the best answer, and
/// many are pivoted. Problems without a solution mostly stay above it.
const NEAR: f64 = 1e-4;

/// The stages of [`Method::Auto`] so far: the result of each, and the best answer.
struct Ladder<'a> {
    options: &'a SolverOptions,
    /// Iterations before the current stage.
    before: usize,
    /// The best answer, whose impulse is in the scratch.
    nearest: StageResult,
}

impl<'a> Ladder<'a> {
    fn new(options: &'a SolverOptions) -> Self {
        Self {
            options,
            before: 0,
            nearest: StageResult {
                method: Method::Newton,
                stage: Stage::AtRest,
                status: SolveStatus::Stalled,
                residual: Residual::UNSOLVED,
            },
        }
    }

    /// Enters a stage that ended with `p`; an outcome if it is the answer.
    #[inline]
    fn enter(
        &mut self,
        stage: Stage,
        found: (SolveStatus, Residual),
        p: &[f64],
        scratch: &mut SolveScratch,
        iterations: usize,
    ) -> Option<StageResult> {
        self.enter_as(stage.method(), stage, found, p, scratch, iterations)
    }

    /// Enters a stage whose answer is another method's.
    #[inline]
    fn enter_as(
        &mut self,
        method: Method,
        stage: Stage,
        (status, residual): (SolveStatus, Residual),
        p: &[f64],
        scratch: &mut SolveScratch,
        iterations: usize,
    ) -> Option<StageResult> {
        let is_rounding = status != SolveStatus::NonFinite && self.options.is_rounding(residual);
        let status = if is_rounding {
            SolveStatus::Converged
        } else {
            status
        };
        let status = scratch.list_stage(stage, status, iterations - self.before);
        self.before = iterations;
        let outcome = StageResult {
            method,
            stage,
            status,
            residual,
        };
        if status == SolveStatus::Converged {
            return Some(outcome);
        }
        let is_nearer = self.options.excess(residual) < self.options.excess(self.nearest.residual);
        if is_nearer {
            self.nearest = outcome;
            scratch.nearest.copy_from_slice(p);
        }
        None
    }

    /// Ends with the best answer and the reason of the last stage. `u` is `W p + q` on return.
    fn give_nearest<const D: usize>(
        &self,
        data: &Prepared<'_>,
        p: &mut [f64],
        u: &mut [f64],
        scratch: &SolveScratch,
    ) -> StageResult {
        if !self.nearest.residual.is_finite() {
            return StageResult {
                status: SolveStatus::NonFinite,
                ..self.nearest
            };
        }
        p.copy_from_slice(&scratch.nearest);
        data.W.multiply_add(p, data.q, u);
        StageResult {
            status: scratch
                .rungs
                .as_slice()
                .last()
                .map_or(self.nearest.status, |rung| rung.status),
            residual: data.measure::<D>(p, u),
            ..self.nearest
        }
    }
}

/// Many contacts: sweeps, then islands. The sweeps' answer becomes the start.
fn sweep_many<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    islands: IslandSolver<'_>,
    iterations: &mut usize,
) -> Option<StageResult> {
    let options = ladder.options;
    let budget = SweepBudget {
        sweeps: sweep_budget(data),
        predict: true,
    };
    let found = gauss_seidel::sweeps::<D>(data, options, budget, p, u, scratch, iterations);
    if let Some(outcome) = ladder.enter(Stage::Sweeps, found, p, scratch, *iterations) {
        return Some(outcome);
    }
    if found.0 == SolveStatus::NonFinite {
        return Some(ladder.give_nearest::<D>(data, p, u, scratch));
    }
    let work = &mut scratch.work;
    if let Some((method, status, residual)) =
        islands::solve::<D>(data, options, p, u, work, islands, iterations)
    {
        let (stage, found) = (Stage::Islands, (status, residual));
        scratch.history.note(*iterations, residual);
        let entered = ladder.enter_as(method, stage, found, p, scratch, *iterations);
        if let Some(outcome) = entered {
            return Some(outcome);
        }
    }
    scratch.start.copy_from_slice(p);
    None
}

/// Pivoting from the start that the scratch keeps and `p` is: from it, with larger `α`, and from
/// its loads alone. `p` is zero on return without an answer: a warm start may mislead, zero does
/// not.
fn pivot_from_start<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    let options = ladder.options;
    let found = pivoting::pivots::<D>(data, options, None, p, u, scratch, iterations);
    if let Some(outcome) = ladder.enter(Stage::Pivoting, found, p, scratch, *iterations) {
        return Some(outcome);
    }
    let found = pivoting::further_pivots::<D>(data, options, p, u, scratch, iterations);
    if let Some(outcome) = ladder.enter(Stage::Pivoting, found, p, scratch, *iterations) {
        return Some(outcome);
    }
    // Friction may point to modes that lead nowhere: the next path starts from the loads alone.
    for (p, start) in p.chunks_exact_mut(D).zip(scratch.start.chunks_exact(D)) {
        p.fill(0.0);
        p[0] = start[0];
    }
    let found = pivoting::pivots::<D>(data, options, None, p, u, scratch, iterations);
    if let Some(outcome) = ladder.enter(Stage::Pivoting, found, p, scratch, *iterations) {
        return Some(outcome);
    }
    p.fill(0.0);
    None
}

/// Few contacts that share no body, without a warm start: one sweep solves each exactly, and as
/// nothing couples them, their order does not matter. `p` is zero on return without an answer.
fn sweep_separate<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    let once = SweepBudget {
        sweeps: 1,
        predict: false,
    };
    let options = ladder.options;
    let found = gauss_seidel::sweeps::<D>(data, options, once, p, u, scratch, iterations);
    let outcome = ladder.enter(Stage::Sweeps, found, p, scratch, *iterations);
    if outcome.is_none() {
        p.fill(0.0);
    }
    outcome
}

/// Few contacts without a warm start. The next stage starts from zero.
fn guide_from_rest<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    if data.mu.len() > 1 && data.W.is_uncoupled::<D>(data.n) {
        let found = sweep_separate::<D>(data, ladder, p, u, scratch, iterations);
        if found.is_some() {
            return found;
        }
    }
    let options = ladder.options;
    let found = match guided::solve::<D>(data, options, p, u, scratch, iterations) {
        Some(residual) => (SolveStatus::Converged, residual),
        None => (SolveStatus::Stalled, Residual::UNSOLVED),
    };
    if let Some(outcome) = ladder.enter(Stage::GuidedNewton, found, p, scratch, *iterations) {
        return Some(outcome);
    }
    p.fill(0.0);
    None
}

/// The proximal point method from `p`.
fn descend<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    let found = proximal::solve::<D>(data, options, p, u, scratch, iterations);
    ladder.enter(Stage::ProximalPoint, found, p, scratch, *iterations)
}

/// Many contacts: pivoting from the last attempt's answer `p`, if it is near.
///
/// Where bodies touch at many points, `W` has a large null space. An answer may then violate the
/// laws by 1e-9 and lie far from a true one: impulses have to move through the null space until a
/// contact opens. Pivoting goes there in one step, the proximal point method in thousands. Where
/// its modes go in circles, it goes on from the nearest answer in a random order.
fn pivot_from_attempt<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    at_random: usize,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    if data.measure::<D>(p, u).relative > NEAR {
        return None;
    }
    scratch.start.copy_from_slice(p);
    let found = pivot_from_start::<D>(data, ladder, p, u, scratch, iterations);
    if found.is_some() || scratch.work.is_exhausted {
        return found;
    }
    let options = ladder.options;
    p.copy_from_slice(&scratch.nearest);
    data.W.multiply_add(p, data.q, u);
    let found = pivoting::random_pivots::<D>(data, options, at_random, p, u, scratch, iterations);
    ladder.enter(Stage::Pivoting, found, p, scratch, *iterations)
}

/// Many contacts: the proximal point method from the nearest answer, from zero, and again from the
/// nearest one, with pivoting after each attempt. What is near by its residual may be far by its
/// modes, and then a start from zero takes a tenth of the steps; so the first two attempts are
/// short.
fn descend_many<const D: usize>(
    data: &Prepared<'_>,
    ladder: &mut Ladder<'_>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    iterations: &mut usize,
) -> Option<StageResult> {
    let options = ladder.options;
    let brief = SolverOptions {
        max_newton_steps: ATTEMPT.min(options.max_newton_steps),
        ..*options
    };
    let attempts = [
        (false, &brief, FEW_AT_RANDOM),
        (true, &brief, AT_RANDOM),
        (false, options, AT_RANDOM),
    ];
    for (is_from_zero, options, at_random) in attempts {
        if is_from_zero {
            p.fill(0.0);
        } else {
            p.copy_from_slice(&scratch.nearest);
        }
        let found = descend::<D>(data, ladder, options, p, u, scratch, iterations);
        if found.is_some() || scratch.work.is_exhausted {
            return found;
        }
        let found = pivot_from_attempt::<D>(data, ladder, at_random, p, u, scratch, iterations);
        if found.is_some() || scratch.work.is_exhausted {
            return found;
        }
    }
    None
}

/// [`Method::Auto`]: cheap stages first, robust ones last.
pub(in crate::solver) fn escalate<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut SolveScratch,
    islands: IslandSolver<'_>,
    iterations: &mut usize,
) -> StageResult {
    let mut ladder = Ladder::new(options);
    scratch.start.copy_from_slice(p);
    let steps = newton::FULL_STEPS.min(options.max_newton_steps);
    let is_few = data.mu.len() <= options.direct_contacts;
    let is_warm = p.iter().any(|x| x.abs() > 0.0);
    let found = if !is_few {
        sweep_many::<D>(data, &mut ladder, p, u, scratch, islands, iterations)
    } else if is_warm {
        pivot_from_start::<D>(data, &mut ladder, p, u, scratch, iterations)
    } else if data.q.chunks_exact(D).any(|q| q[0] < 0.0) {
        guide_from_rest::<D>(data, &mut ladder, p, u, scratch, iterations)
    } else {
        None
    };
    if let Some(outcome) = found {
        return outcome;
    }
    let found = newton::full_steps::<D>(data, options, steps, p, u, scratch, iterations);
    if let Some(outcome) = ladder.enter(Stage::Newton, found, p, scratch, *iterations) {
        return outcome;
    }
    p.copy_from_slice(&scratch.start);
    if !is_few {
        let found = interior_point::solve::<D>(data, options, p, u, scratch, iterations);
        if let Some(outcome) = ladder.enter(Stage::InteriorPoint, found, p, scratch, *iterations) {
            return outcome;
        }
    }
    let found = if is_few {
        descend::<D>(data, &mut ladder, options, p, u, scratch, iterations)
    } else {
        descend_many::<D>(data, &mut ladder, p, u, scratch, iterations)
    };
    if let Some(outcome) = found {
        return outcome;
    }
    if is_few && ladder.nearest.residual.is_finite() {
        let found = restarts::solve::<D>(data, options, p, u, scratch, iterations);
        if let Some(outcome) = ladder.enter(Stage::Restarts, found, p, scratch, *iterations) {
            return outcome;
        }
        if ladder.nearest.residual.relative < NEAR {
            p.copy_from_slice(&scratch.nearest);
            let found = descend::<D>(data, &mut ladder, options, p, u, scratch, iterations);
            if let Some(outcome) = found {
                return outcome;
            }
        }
    }
    ladder.give_nearest::<D>(data, p, u, scratch)
}
