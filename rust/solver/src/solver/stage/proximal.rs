//! Proximal point method with an inner Newton method: a sequence of well-posed regularised
//! problems.
//!
//! A step from the centre `c` solves the problem with `W + α I` and `q − α c`. Its fixed points are
//! the solutions of the given problem, and `W` need not have full rank (Acary, Brémond and Huber
//! 2018, section 8). `α` starts at the size of `W`, where the problem is easy. It then shrinks with
//! the centre fixed at the start, which follows Tikhonov's path to the solution nearest to the
//! start. When a step fails, the last good answer becomes the centre and `α` grows again.
//!
//! The inner method takes Newton steps with backtracking on the natural map of the regularised
//! problem, and Gauss–Seidel sweeps when backtracking fails. Once a step is cheap, a *sprint* with
//! a small `α` tries to finish with Newton's convergence.

use crate::problem::Proximal;
use crate::solver::linear::reduced_system::{Factorisation, NewtonStep, ReducedSystem};
use crate::solver::local::modes;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};

/// Most Newton steps for one value of `α`.
const INNER_STEPS: usize = 30;
/// Factor by which `α` shrinks along Tikhonov's path.
const PATH_SHRINK: f64 = 0.1;
/// `α` shrinks if a proximal step leaves more than this fraction of the residual.
const SLOW: f64 = 0.1;
/// Newton steps of a sprint, and those of a proximal step that is cheap enough to try one.
const SPRINT: usize = 8;
const CHEAP: usize = 3;
/// Relative natural map required of a step with a large `α`.
const LOOSE: f64 = 1e-7;
/// Relative natural map below which a failed descent is due to rounding.
const ROUNDING: f64 = 1e-13;
/// Halvings of a Newton step.
const HALVINGS: usize = 6;
/// Consecutive failed Newton steps that end a descent, and the sweeps after each.
const MAX_STUCK: usize = 4;
const SWEEPS: usize = 10;
/// Consecutive failures after which the method gives up.
const MAX_FAILURES: usize = 12;
/// Smallest `α` relative to the mean diagonal.
const SMALLEST: f64 = 1e-13;

/// The choice of `α` from step to step.
///
/// A small `α` gains much per step, but below some bound the inner Newton fails, at ten times the
/// cost of a successful step. After a failure the next attempt therefore stays between the failed
/// value and the last successful one, and comes later.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Current `α`, 1/kg.
    alpha: f64,
    /// Last `α` whose step succeeded, 1/kg.
    proved: f64,
    /// Whether the centre is still the start.
    follows_path: bool,
    /// Factor of the next reduction.
    shrink: f64,
    /// Successes since the last change of `α`.
    successes: usize,
    /// Successes that a reduction of `α` has to wait for.
    patience: usize,
    /// Failures in a row.
    failures: usize,
    /// Whether the last step was cheap.
    cheap: bool,
    /// Steps since the last sprint, and how many have to pass before the next.
    since_sprint: usize,
    sprint_wait: usize,
}

impl Course {
    fn new(alpha: f64) -> Self {
        Self {
            alpha,
            proved: f64::INFINITY,
            follows_path: true,
            shrink: PATH_SHRINK,
            successes: 0,
            patience: 1,
            failures: 0,
            cheap: false,
            since_sprint: 0,
            sprint_wait: 2,
        }
    }

    /// Whether to try a sprint; never while on Tikhonov's path.
    fn begins_sprint(&mut self) -> bool {
        self.since_sprint += 1;
        let begins = self.cheap && !self.follows_path && self.since_sprint > self.sprint_wait;
        if begins {
            self.since_sprint = 0;
            self.cheap = false;
        }
        begins
    }

    /// The next problem: a sprint with the `target` for `α`, or a proximal step. `last`: residual
    /// of the last step; `asked`: the one required with the smallest `α`.
    fn task(&self, sprints: bool, target: f64, last: f64, asked: f64) -> Task {
        if sprints {
            return Task {
                alpha: target,
                tolerance: 1e-2 * asked,
                exact: false,
                steps: SPRINT,
            };
        }
        let coarse = self.alpha > target;
        let tolerance = if coarse {
            LOOSE.min(1e-2 * last)
        } else {
            1e-2 * asked
        };
        Task {
            alpha: self.alpha,
            tolerance,
            exact: true,
            steps: INNER_STEPS,
        }
    }

    /// Reduces `α` along Tikhonov's path after a success; false if the path has ended.
    fn follow_path(&mut self, target: f64) -> bool {
        let follows = self.follows_path && self.alpha > target;
        if follows {
            self.proved = self.alpha;
            self.alpha = (self.alpha * PATH_SHRINK).max(target);
        }
        follows
    }

    fn succeed(&mut self, slow: bool, steps: usize, smallest: f64) {
        self.follows_path = false;
        self.failures = 0;
        self.cheap = steps <= CHEAP;
        if self.alpha < self.proved {
            self.patience = (self.patience / 2).max(1);
        }
        self.proved = self.alpha;
        // Steps that take a single linear solve show that a smaller α would do.
        self.successes += if steps <= 1 { 4 } else { 1 };
        if slow && self.successes >= self.patience {
            self.alpha = (self.alpha * self.shrink).max(smallest);
            self.successes = 0;
        }
    }

    /// Whether another attempt is worth it.
    fn fail(&mut self, largest: f64) -> bool {
        self.follows_path = false;
        self.failures += 1;
        self.successes = 0;
        self.patience = (2 * self.patience).min(16);
        if self.proved > self.alpha && self.proved.is_finite() && self.failures < 4 {
            self.shrink = (self.alpha / self.proved).sqrt().min(0.8);
            self.alpha = if self.shrink > 0.6 {
                self.proved
            } else {
                self.alpha / self.shrink
            };
        } else {
            self.alpha = (10.0 * self.alpha).min(largest);
            self.proved = self.alpha;
        }
        self.failures <= MAX_FAILURES
    }
}

/// One regularised problem to solve.
#[derive(Clone, Copy, Debug)]
struct Task {
    /// `α`, 1/kg; the centre is in the scratch.
    alpha: f64,
    /// Relative natural map to reach.
    tolerance: f64,
    /// Whether to start with the exact predictor.
    exact: bool,
    /// Most Newton steps.
    steps: usize,
}

/// Accepts the answer of a sprint that gained enough; otherwise goes back to the accepted one.
fn end_sprint<const D: usize>(attempt: &mut Attempt<'_, D>, course: &mut Course, gained: bool) {
    let Attempt { p, scratch, .. } = attempt;
    if gained {
        scratch.accepted.copy_from_slice(p);
    } else {
        p.copy_from_slice(&scratch.accepted);
        course.sprint_wait *= 2;
    }
    scratch.system.centre.copy_from_slice(p);
}

/// Backtracks from `scratch.system.trial` towards `(p, u)` until the natural map falls; `false`,
/// with `(p, u)` unchanged, if it never does.
fn backtrack<const D: usize>(attempt: &mut Attempt<'_, D>, alpha: f64, current: f64) -> bool {
    let data = attempt.data;
    let Attempt { p, u, scratch, .. } = attempt;
    let directions = scratch.direction.iter_mut().zip(&scratch.system.trial);
    for ((d, t), x) in directions.zip(&**p) {
        *d = t - x;
    }
    scratch.system.trial_velocity.fill(0.0);
    data.W.multiply_add(
        &scratch.direction,
        &scratch.system.trial_velocity,
        &mut scratch.image,
    );
    let mut t = 1.0;
    for _ in 0..HALVINGS {
        for k in 0..data.n {
            scratch.system.trial[k] = p[k] + t * scratch.direction[k];
            scratch.system.trial_velocity[k] = u[k] + t * scratch.image[k];
        }
        let (trial, velocity) = (&scratch.system.trial, &scratch.system.trial_velocity);
        if data.merit::<D>(scratch.system.prox(alpha), trial, velocity) < (1.0 - 1e-3 * t) * current
        {
            p.copy_from_slice(trial);
            u.copy_from_slice(velocity);
            return true;
        }
        t *= 0.5;
    }
    false
}

/// Solves one regularised problem with the centre `scratch.system.centre`, from `p`; true if its
/// natural map fell below the tolerance. `u = W p + q` on return.
fn descend<const D: usize>(attempt: &mut Attempt<'_, D>, task: Task) -> bool {
    let Task {
        alpha,
        tolerance,
        mut exact,
        steps,
    } = task;
    let data = attempt.data;
    attempt.find_velocity();
    let threshold = (tolerance / data.inverse_data).powi(2);
    let mut stuck = 0;
    for step in 0..=steps {
        let Attempt { p, u, scratch, .. } = &mut *attempt;
        let current = data.merit::<D>(scratch.system.prox(alpha), p, u);
        if !current.is_finite() || step == steps {
            return current <= threshold;
        }
        if current <= threshold {
            break;
        }
        let ReducedSystem { centre, modes, .. } = &mut scratch.system;
        let prox = Proximal { alpha, centre };
        modes::predict::<D>(data, prox, exact, p, u, modes);
        let factors = (scratch.system).factorise::<D>(data, alpha, false, &mut scratch.work);
        let mut accepted = false;
        if factors != Factorisation::None || scratch.system.m == 0 {
            let newton_step = NewtonStep {
                alpha,
                factors,
                on_cone: false,
            };
            scratch.system.newton_point::<D>(data, newton_step, p, u);
            accepted = backtrack(attempt, alpha, current);
        }
        attempt.iterations += 1;
        if accepted {
            stuck = 0;
            continue;
        }
        if current.sqrt() * data.inverse_data < ROUNDING {
            break;
        }
        // A contact that may either open or carry load has two exact solutions; the projection
        // keeps the current one.
        exact = !exact;
        stuck += 1;
        if stuck > MAX_STUCK || !attempt.sweep(alpha, SWEEPS) {
            return false;
        }
        attempt.find_velocity();
    }
    attempt.find_velocity();
    true
}

/// Proximal point from `p`, with at most so many linear solves. `u = W p + q` on return; without
/// convergence `p` is the best impulse found.
pub(in crate::solver) fn solve<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    most_steps: usize,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    attempt.find_velocity();
    let mut best = attempt.measure();
    if options.accepts(best) {
        return (SolveStatus::Converged, best);
    }
    if !best.is_finite() {
        return (SolveStatus::NonFinite, best);
    }
    let scratch = &mut *attempt.scratch;
    for kept in [
        &mut scratch.best,
        &mut scratch.accepted,
        &mut scratch.system.centre,
    ] {
        kept.copy_from_slice(attempt.p);
    }
    let target = options.regularisation * data.mean_diagonal;
    let mut course = Course::new(data.mean_diagonal);
    let mut last = f64::INFINITY;
    // Required of a step with the smallest α; tightened if it holds and the velocity is still
    // inaccurate.
    let mut asked = options.tolerance;
    let limit = attempt.iterations + most_steps;
    let mut status = SolveStatus::MaxIterations;
    while attempt.iterations < limit && !attempt.scratch.work.is_exhausted {
        let sprints = course.begins_sprint();
        if sprints {
            attempt.scratch.system.centre.copy_from_slice(attempt.p);
        }
        let task = course.task(sprints, target, last, asked);
        let before = attempt.iterations;
        let solved = descend(attempt, task);
        // Count a round even if its start was its answer, so that the search ends.
        attempt.iterations = attempt.iterations.max(before + 1);
        let residual = attempt.measure();
        if options.accepts(residual) || (residual.relative < LOOSE && attempt.is_within_rounding())
        {
            return (SolveStatus::Converged, residual);
        }
        if residual.relative <= asked {
            asked *= 0.1;
        }
        attempt.keep_if_better(residual, &mut best);
        if sprints {
            let gained = residual.relative < SLOW * last;
            if gained {
                last = residual.relative;
            }
            end_sprint(attempt, &mut course, gained);
            continue;
        }
        let Attempt { p, scratch, .. } = &mut *attempt;
        if solved {
            scratch.accepted.copy_from_slice(p);
            let slow = residual.relative > SLOW * last;
            last = residual.relative;
            if !course.follow_path(target) {
                scratch.system.centre.copy_from_slice(p);
                let steps = attempt.iterations - before;
                course.succeed(slow, steps, SMALLEST * data.mean_diagonal);
            }
        } else {
            p.copy_from_slice(&scratch.accepted);
            scratch.system.centre.copy_from_slice(p);
            if !course.fail(100.0 * data.mean_diagonal) {
                status = SolveStatus::Stalled;
                break;
            }
        }
    }
    attempt.take_best();
    (status, attempt.residual())
}
