//! Sweeps that are extrapolated, judged and kept from adding energy, whatever a sweep visits.
//!
//! The next sweep starts not from the impulses p_k but from `p_k + β (p_k − p_{k−1})`, with β from
//! Nesterov's sequence. Where the change per sweep grows the sequence goes back, to its start or,
//! for balls, part of the way ([`Relaxation::KEPT`]). That saves sweeps in most problems and may
//! never end in a wedged one, so it ends after a while.

use crate::problem::{Residual, passive_share};
use crate::solver::options::SolverOptions;
use crate::solver::report::{SolveReport, SolveStatus};

/// Quality of an answer.
pub(super) struct SolutionQuality {
    pub residual: Residual,
    /// pᵀu, J.
    pub work: f64,
    /// pᵀq, J.
    pub free: f64,
}

impl SolutionQuality {
    fn is_within(&self, options: &SolverOptions) -> bool {
        self.residual.relative <= options.tolerance
            && self.residual.velocity <= options.velocity_tolerance
    }
}

/// Sweeps after which a problem counts as hard: every short cut ends then.
const HARD: usize = 300;

/// Sweeps before the first extrapolation of drifts, from one to the next, and those over which a
/// drift is measured.
const EASY: usize = 100;
const PERIOD: usize = 20;
const DRIFT: usize = 5;

/// Contacts that are swept.
pub(super) trait Relaxation {
    /// Fraction of Nesterov's sequence that is kept when the change per sweep grows.
    const KEPT: f64;

    /// Sweeps after which the residual is computed, whatever the change per sweep.
    const PATIENCE: usize;

    /// One sweep from the impulses extrapolated by `share`; the square of its change, N² s². In a
    /// hard problem it visits every contact.
    fn sweep(&mut self, share: f64, is_hard: bool) -> f64;

    /// The residual as [`crate::problem::evaluate_into`] defines it, with the velocities summed
    /// anew from the impulses.
    fn measure(&mut self) -> SolutionQuality;

    /// Multiplies all impulses.
    fn scale(&mut self, share: f64);

    /// Remembers the impulses from which [`Self::extrapolate_drift`] measures their drift.
    fn anchor(&mut self) {}

    /// Goes on along the drift as far as energy falls; whether it has.
    fn extrapolate_drift(&mut self) -> bool {
        false
    }
}

/// Sweeps until the answer is within the tolerances. The impulses are those of the last
/// measurement.
pub(super) fn accelerate<R: Relaxation>(
    contacts: &mut R,
    options: &SolverOptions,
    report: &mut SolveReport,
) {
    let (mut t, mut share, mut last_change) = (1.0_f64, 0.0, f64::INFINITY);
    // Violation, in tolerances, per N s of a sweep's change: tells when to compute the
    // residual.
    let (mut rate, mut last_look) = (f64::INFINITY, 0);
    loop {
        if report.iterations < options.max_sweeps {
            let is_hard = report.iterations >= HARD;
            let change = contacts.sweep(share, is_hard);
            report.iterations += 1;
            if change > last_change {
                let kept = if is_hard { 0.0 } else { R::KEPT };
                t = 1.0 + kept * (t - 1.0);
            }
            last_change = change;
            if report.iterations >= EASY {
                let since = report.iterations - EASY;
                if since % PERIOD == PERIOD - DRIFT {
                    contacts.anchor();
                } else if since >= PERIOD
                    && since.is_multiple_of(PERIOD)
                    && contacts.extrapolate_drift()
                {
                    (t, last_change) = (1.0, f64::INFINITY);
                }
            }
            let is_due = rate * change.sqrt() <= 1.0
                || report.iterations - last_look >= R::PATIENCE
                || report.iterations == 1
                || report.iterations == options.max_sweeps;
            if !is_due {
                share = next_share(&mut t);
                continue;
            }
        }
        let is_last = report.iterations >= options.max_sweeps;
        let mut measured = contacts.measure();
        if (is_last || measured.is_within(options))
            && let Some(share) = passive_share(measured.work, measured.free)
        {
            contacts.scale(share);
            measured = contacts.measure();
            t = 1.0;
        }
        let Residual { relative, velocity } = measured.residual;
        (report.residual, report.velocity_error) = (relative, velocity);
        if !measured.residual.is_finite() {
            report.status = SolveStatus::NonFinite;
            return;
        }
        if measured.is_within(options) {
            return;
        }
        if is_last {
            report.status = SolveStatus::MaxIterations;
            return;
        }
        let violation = (relative / options.tolerance).max(velocity / options.velocity_tolerance);
        (rate, last_look) = (violation / last_change.sqrt(), report.iterations);
        share = next_share(&mut t);
    }
}

/// Extrapolation factor after a sweep; advances Nesterov's sequence.
fn next_share(t: &mut f64) -> f64 {
    let next = 0.5 * (1.0 + (1.0 + 4.0 * *t * *t).sqrt());
    let share = (*t - 1.0) / next;
    *t = next;
    share
}
