//! [`Method::Auto`]: cheap stages first, robust ones last. The table of the
//! [chapter](crate::solver) gives the reason for each rung.

use super::islands::{self, IslandSolver};
use crate::problem::{Operator, Prepared, Residual};
use crate::solver::options::Method;
use crate::solver::report::{SolveStatus, Stage, StageResult};
use crate::solver::scratch::{Attempt, StageEnd};
use crate::solver::stage::{
    gauss_seidel, guided, interior_point, newton, pivoting, proximal, pyramids, restarts,
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
struct Ladder<'a, 'b, const D: usize> {
    attempt: &'a mut Attempt<'b, D>,
    /// Iterations before the current stage.
    before: usize,
    /// The best answer, whose impulse is in the scratch.
    nearest: StageResult,
}

impl<'a, 'b, const D: usize> Ladder<'a, 'b, D> {
    fn new(attempt: &'a mut Attempt<'b, D>) -> Self {
        Self {
            attempt,
            before: 0,
            nearest: StageResult {
                method: Method::Newton,
                stage: Stage::AtRest,
                status: SolveStatus::Stalled,
                residual: Residual::UNSOLVED,
            },
        }
    }

    /// Enters a stage; an outcome if it is the answer.
    #[inline]
    fn enter(&mut self, stage: Stage, found: StageEnd) -> Option<StageResult> {
        self.enter_as(stage.method(), stage, found)
    }

    /// Enters a stage whose answer is another method's.
    #[inline]
    fn enter_as(
        &mut self,
        method: Method,
        stage: Stage,
        (status, residual): StageEnd,
    ) -> Option<StageResult> {
        let attempt = &mut *self.attempt;
        let options = attempt.options;
        let is_rounding = status != SolveStatus::NonFinite && options.is_rounding(residual);
        let status = if is_rounding {
            SolveStatus::Converged
        } else {
            status
        };
        let iterations = attempt.iterations - self.before;
        let status = attempt.scratch.list_stage(stage, status, iterations);
        self.before = attempt.iterations;
        let outcome = StageResult {
            method,
            stage,
            status,
            residual,
        };
        if status == SolveStatus::Converged {
            return Some(outcome);
        }
        let is_nearer = options.excess(residual) < options.excess(self.nearest.residual);
        if is_nearer {
            self.nearest = outcome;
            attempt.scratch.nearest.copy_from_slice(attempt.p);
        }
        None
    }

    /// Goes back to the best answer.
    fn take_nearest(&mut self) {
        let Attempt { p, scratch, .. } = &mut *self.attempt;
        p.copy_from_slice(&scratch.nearest);
    }

    fn is_exhausted(&self) -> bool {
        self.attempt.scratch.work.is_exhausted
    }

    /// Ends with the best answer, if it is acceptable.
    fn accept(&mut self) -> Option<StageResult> {
        let options = self.attempt.options;
        options
            .is_acceptable(self.nearest.residual)
            .then(|| StageResult {
                status: SolveStatus::Acceptable,
                ..self.give_nearest()
            })
    }

    /// Ends with the best answer and the reason of the last stage. `u` is `W p + q` on return.
    fn give_nearest(&mut self) -> StageResult {
        if !self.nearest.residual.is_finite() {
            return StageResult {
                status: SolveStatus::NonFinite,
                ..self.nearest
            };
        }
        self.take_nearest();
        self.attempt.find_velocity();
        let rungs = self.attempt.scratch.rungs.as_slice();
        StageResult {
            status: (rungs.last()).map_or(self.nearest.status, |rung| rung.status),
            residual: self.attempt.residual(),
            ..self.nearest
        }
    }

    /// Many contacts: sweeps, then islands. The sweeps' answer becomes the start.
    fn sweep_many(&mut self, islands: IslandSolver<'_>) -> Option<StageResult> {
        let budget = SweepBudget {
            sweeps: sweep_budget(self.attempt.data),
            predict: true,
        };
        let found = gauss_seidel::sweeps(self.attempt, budget);
        if let Some(outcome) = self.enter(Stage::Sweeps, found) {
            return Some(outcome);
        }
        if found.0 == SolveStatus::NonFinite {
            return Some(self.give_nearest());
        }
        if let Some((method, found)) = islands::solve(self.attempt, islands) {
            let Attempt {
                scratch,
                iterations,
                ..
            } = &mut *self.attempt;
            scratch.history.note(*iterations, found.1);
            if let Some(outcome) = self.enter_as(method, Stage::Islands, found) {
                return Some(outcome);
            }
        }
        self.attempt.scratch.start.copy_from_slice(self.attempt.p);
        None
    }

    /// Pivoting from the start that the scratch keeps and `p` is: from it, with larger `α`, and
    /// from its loads alone. `p` is zero on return without an answer: a warm start may mislead,
    /// zero does not.
    fn pivot_from_start(&mut self) -> Option<StageResult> {
        let found = pivoting::pivots(self.attempt, None);
        if let Some(outcome) = self.enter(Stage::Pivoting, found) {
            return Some(outcome);
        }
        let found = pivoting::further_pivots(self.attempt);
        if let Some(outcome) = self.enter(Stage::Pivoting, found) {
            return Some(outcome);
        }
        // Friction may point to modes that lead nowhere: the next path starts from the loads alone.
        let Attempt { p, scratch, .. } = &mut *self.attempt;
        for (p, start) in p.chunks_exact_mut(D).zip(scratch.start.chunks_exact(D)) {
            p.fill(0.0);
            p[0] = start[0];
        }
        let found = pivoting::pivots(self.attempt, None);
        if let Some(outcome) = self.enter(Stage::Pivoting, found) {
            return Some(outcome);
        }
        self.attempt.p.fill(0.0);
        None
    }

    /// Few contacts that share no body, without a warm start: one sweep solves each exactly, and as
    /// nothing couples them, their order does not matter. `p` is zero on return without an answer.
    fn sweep_separate(&mut self) -> Option<StageResult> {
        let once = SweepBudget {
            sweeps: 1,
            predict: false,
        };
        let found = gauss_seidel::sweeps(self.attempt, once);
        let outcome = self.enter(Stage::Sweeps, found);
        if outcome.is_none() {
            self.attempt.p.fill(0.0);
        }
        outcome
    }

    /// Newton on predicted modes.
    fn take_full_steps(&mut self) -> Option<StageResult> {
        let most_steps = newton::FULL_STEPS.min(self.attempt.options.max_newton_steps);
        let found = newton::full_steps(self.attempt, most_steps);
        self.enter(Stage::Newton, found)
    }

    /// Few contacts from rest.
    fn solve_from_rest(&mut self) -> Option<StageResult> {
        let closes = self.attempt.data.q.chunks_exact(D).any(|q| q[0] < 0.0);
        let found = if closes { self.guide_from_rest() } else { None };
        found.or_else(|| self.take_full_steps())
    }

    /// Few contacts of which one closes, without a warm start. The next stage starts from zero.
    fn guide_from_rest(&mut self) -> Option<StageResult> {
        let data = self.attempt.data;
        if data.mu.len() > 1 && data.W.is_uncoupled::<D>(data.n) {
            let found = self.sweep_separate();
            if found.is_some() {
                return found;
            }
        }
        let found = match guided::solve(self.attempt) {
            Some(residual) => (SolveStatus::Converged, residual),
            None => (SolveStatus::Stalled, Residual::UNSOLVED),
        };
        if let Some(outcome) = self.enter(Stage::GuidedNewton, found) {
            return Some(outcome);
        }
        self.attempt.p.fill(0.0);
        None
    }

    /// The proximal point method from `p`.
    fn descend(&mut self, most_steps: usize) -> Option<StageResult> {
        let found = proximal::solve(self.attempt, most_steps);
        self.enter(Stage::ProximalPoint, found)
    }

    /// Few contacts whose quick stages have failed: pyramids, pivoting from other starts, and a
    /// short descent, each until the nearest answer is acceptable.
    fn unwedge(&mut self) -> Option<StageResult> {
        let found = pyramids::solve(self.attempt);
        let outcome = self.enter(Stage::Pyramids, found);
        if let Some(outcome) = outcome.or_else(|| self.accept()) {
            return Some(outcome);
        }
        let ends = self.attempt.options.is_brief || self.is_exhausted();
        if ends || !self.nearest.residual.is_finite() {
            return None;
        }
        let found = restarts::solve(self.attempt);
        let outcome = self.enter(Stage::Restarts, found);
        if let Some(outcome) = outcome.or_else(|| self.accept()) {
            return Some(outcome);
        }
        self.take_nearest();
        let most_steps = ATTEMPT.min(self.attempt.options.max_newton_steps);
        self.descend(most_steps).or_else(|| self.accept())
    }

    /// Many contacts: Newton, the interior point method, and the proximal point method.
    fn follow_and_descend(&mut self) -> Option<StageResult> {
        let outcome = self.take_full_steps();
        if outcome.is_some() {
            return outcome;
        }
        let Attempt { p, scratch, .. } = &mut *self.attempt;
        p.copy_from_slice(&scratch.start);
        let found = interior_point::solve(self.attempt);
        let outcome = self.enter(Stage::InteriorPoint, found);
        outcome.or_else(|| self.descend_many())
    }

    /// Many contacts: pivoting from the last attempt's answer `p`, if it is near.
    ///
    /// Where bodies touch at many points, `W` has a large null space. An answer may then violate
    /// the laws by 1e-9 and lie far from a true one: impulses have to move through the null space
    /// until a contact opens. Pivoting goes there in one step, the proximal point method in
    /// thousands. Where its modes go in circles, it goes on from the nearest answer in a random
    /// order.
    fn pivot_from_attempt(&mut self, at_random: usize) -> Option<StageResult> {
        if self.attempt.residual().relative > NEAR {
            return None;
        }
        self.attempt.scratch.start.copy_from_slice(self.attempt.p);
        let found = self.pivot_from_start();
        if found.is_some() || self.is_exhausted() {
            return found;
        }
        self.take_nearest();
        self.attempt.find_velocity();
        let found = pivoting::random_pivots(self.attempt, at_random);
        self.enter(Stage::Pivoting, found)
    }

    /// Many contacts: the proximal point method from the nearest answer, from zero, and again from
    /// the nearest one, with pivoting after each attempt. What is near by its residual may be far
    /// by its modes, and then a start from zero takes a tenth of the steps; so the first two
    /// attempts are short.
    fn descend_many(&mut self) -> Option<StageResult> {
        let all = self.attempt.options.max_newton_steps;
        let few = ATTEMPT.min(all);
        let attempts = [
            (false, few, FEW_AT_RANDOM),
            (true, few, AT_RANDOM),
            (false, all, AT_RANDOM),
        ];
        for (is_from_zero, most_steps, at_random) in attempts {
            if is_from_zero {
                self.attempt.p.fill(0.0);
            } else {
                self.take_nearest();
            }
            let found = self.descend(most_steps);
            if found.is_some() || self.is_exhausted() {
                return found;
            }
            let found = self.pivot_from_attempt(at_random);
            if found.is_some() || self.is_exhausted() {
                return found;
            }
        }
        None
    }
}

/// [`Method::Auto`]: cheap stages first, robust ones last.
pub(in crate::solver) fn escalate<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    islands: IslandSolver<'_>,
) -> StageResult {
    let (data, options) = (attempt.data, attempt.options);
    attempt.scratch.start.copy_from_slice(attempt.p);
    let is_few = data.mu.len() <= options.direct_contacts;
    let is_warm = attempt.p.iter().any(|x| x.abs() > 0.0);
    let mut ladder = Ladder::new(attempt);
    let found = if !is_few {
        ladder.sweep_many(islands)
    } else if options.is_pivoted {
        None
    } else if is_warm {
        let found = pivoting::pivots(ladder.attempt, None);
        ladder.enter(Stage::Pivoting, found)
    } else {
        ladder.solve_from_rest()
    };
    if let Some(outcome) = found {
        return outcome;
    }
    let found = if is_few {
        ladder.unwedge()
    } else {
        ladder.follow_and_descend()
    };
    found.unwrap_or_else(|| ladder.give_nearest())
}
