//! Semismooth Newton on the contact modes.
//!
//! A step predicts each contact's mode ([`modes`]) for the regularised velocity
//! `û = W p + q + α (p − c)` and solves the equations of those modes ([`ReducedSystem`]). Once the
//! modes are right, convergence is quadratic, and finite if nothing slides. `α > 0` makes the
//! system regular when `W` is not: every step is a proximal step, which leaves the null space of
//! `W` at the centre `c`.

use crate::problem::{Proximal, Residual};
use crate::solver::linear::reduced_system::{Factorisation, NewtonStep, ReducedSystem};
use crate::solver::local::modes;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};

/// Most full steps before the safeguarded method takes over. Measured on the recorded problems:
/// full steps find the modes within about ten steps or not at all.
pub(in crate::solver) const FULL_STEPS: usize = 24;

/// Steps with changing modes after which a few sweeps break the cycle.
const CYCLE: usize = 8;
const CYCLE_SWEEPS: usize = 3;

/// Residual below which a stop of progress may be the rounding of `W p + q`.
const ROUNDING_ASKED: f64 = 1e-7;

/// Smallest `α` relative to the mean diagonal.
const SMALLEST: f64 = 1e-14;

/// A residual falling at least this much per step lets the old factors serve once more.
const REUSE_CONTRACTION: f64 = 0.02;

/// A regularised step with settled modes should gain at least this factor; otherwise `α` dominates
/// the remaining error.
const SLOW: f64 = 0.1;

/// Relative natural map at which a proximal step counts as solved: `1/α` amplifies its error in the
/// null space of `W`.
const SOLVED: f64 = 1e-15;

/// Steps with settled modes after which the centre moves anyway.
const PATIENCE: usize = 4;

/// State of the iteration from step to step.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Current `α`, 1/kg.
    alpha: f64,
    /// Stored factors.
    factors: Factorisation,
    /// Whether a symmetric factorisation may be used.
    allow_symmetric: bool,
    /// Whether the modes have ever changed, so that the exact predictor is used.
    exact: bool,
    /// Steps since the modes last changed.
    settled: usize,
    /// Residual before the last step.
    last: f64,
}

impl Course {
    /// Decides whether to keep the factors and `α`: from the last step's `progress` (ratio of
    /// residuals), from whether the modes `changed`, and from whether any contact slides with
    /// friction.
    #[inline]
    fn revise(&mut self, progress: f64, [changed, slides]: [bool; 2], smallest: f64) {
        if self.settled > 1 && progress > SLOW && self.factors != Factorisation::None {
            if self.factors == Factorisation::Symmetric && self.allow_symmetric {
                // W may be unsymmetric, so that one triangle of it is not enough.
                self.allow_symmetric = false;
            } else {
                self.alpha = (0.01 * self.alpha).max(smallest);
            }
            self.factors = Factorisation::None;
        }
        if changed || (slides && progress > REUSE_CONTRACTION) {
            self.factors = Factorisation::None;
        }
    }
}

/// Predicts the modes; after the first change with the exact predictor. Returns whether they
/// changed.
#[inline]
fn predict<const D: usize>(attempt: &mut Attempt<'_, D>, course: &mut Course) -> bool {
    let Attempt {
        data,
        p,
        u,
        scratch,
        ..
    } = attempt;
    let ReducedSystem { centre, modes, .. } = &mut scratch.system;
    let prox = Proximal {
        alpha: course.alpha,
        centre,
    };
    let changed = modes::predict::<D>(data, prox, course.exact, p, u, modes);
    if changed && !course.exact {
        course.exact = true;
        modes::predict::<D>(data, prox, true, p, u, modes);
    }
    if changed {
        course.settled = 0;
        return true;
    }
    course.settled += 1;
    // After a change of modes the centre stays until its own proximal step is solved. Otherwise the
    // transient would remain in the null space of W. The modes of the warm start need no such care.
    if !course.exact
        || course.settled > PATIENCE
        || data.merit::<D>(prox, p, u).sqrt() * data.inverse_data <= SOLVED
    {
        centre.copy_from_slice(p);
    }
    false
}

/// Moves `p` to the Newton point of the predicted modes; false if the system is singular or the
/// budget does not allow it.
#[inline]
fn take_step<const D: usize>(attempt: &mut Attempt<'_, D>, course: &mut Course) -> bool {
    let Attempt { data, scratch, .. } = attempt;
    if course.factors == Factorisation::None {
        course.factors = scratch.system.factorise::<D>(
            data,
            course.alpha,
            course.allow_symmetric,
            &mut scratch.work,
        );
        if course.factors == Factorisation::None && scratch.system.m > 0 {
            return false;
        }
    }
    let newton_step = NewtonStep {
        alpha: course.alpha,
        factors: course.factors,
        on_cone: true,
    };
    (scratch.system).newton_point::<D>(data, newton_step, attempt.p, attempt.u);
    attempt.p.copy_from_slice(&scratch.system.trial);
    true
}

/// Full Newton steps from `p`; in steady motion two or three of them solve the step.
///
/// The proximal centre stays at the start until the modes settle and follows the iterate then, so
/// that the last steps refine what the regularisation left. `u` is `W p + q` on return;
/// `iterations` is advanced by the linear solves.
pub(in crate::solver) fn full_steps<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    max_steps: usize,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    let mut course = Course {
        alpha: options.regularisation * data.mean_diagonal,
        factors: Factorisation::None,
        allow_symmetric: true,
        exact: false,
        settled: 0,
        last: f64::INFINITY,
    };
    attempt.find_velocity();
    let system = &mut attempt.scratch.system;
    modes::recall::<D>(data.mu, attempt.p, attempt.u, &mut system.modes);
    let is_warm = attempt.p.iter().any(|x| x.abs() > 0.0);
    system.centre.copy_from_slice(attempt.p);
    let mut best = Residual::UNSOLVED;
    for step in 0.. {
        let residual = attempt.measure();
        attempt.keep_if_better(residual, &mut best);
        if options.accepts(residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            if best.is_finite() {
                break;
            }
            return (SolveStatus::NonFinite, residual);
        }
        let progress = residual.relative / course.last;
        if progress > 0.5 && residual.relative < ROUNDING_ASKED && attempt.is_within_rounding() {
            return (SolveStatus::Converged, residual);
        }
        if step == max_steps {
            break;
        }
        course.last = residual.relative;
        let is_recalled = step == 0 && is_warm;
        let changed = !is_recalled && predict(attempt, &mut course);
        attempt.iterations += 1;
        if changed && step > 0 && step % CYCLE == 0 {
            if !attempt.sweep(course.alpha, CYCLE_SWEEPS) {
                break;
            }
            course.last = f64::INFINITY;
            course.factors = Factorisation::None;
        } else {
            let smallest = SMALLEST * data.mean_diagonal;
            course.revise(progress, [changed, attempt.scratch.system.slides], smallest);
            if !take_step(attempt, &mut course) {
                break;
            }
        }
        attempt.find_velocity();
    }
    attempt.take_best();
    (SolveStatus::Stalled, best)
}
