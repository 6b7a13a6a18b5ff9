//! Semismooth Newton on the contact modes.
//!
//! One step predicts each contact's mode ([`modes`](super::modes)) for the regularised velocity `û = W p + q + α (p − c)` and solves
//! the equations of those modes ([`reduced_system`](super::reduced_system)). Once the modes are right the convergence is quadratic, and
//! finite when nothing slides. `α > 0` makes the system regular when `W` is not: every step is a proximal step, whose answer moves
//! from the centre `c` no farther than `W` asks.

use super::modes::{self, Proximal};
use super::reduced_system::{self, Factors};
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, auto::Prepared, nsgs};
use crate::problem::{Residual, multiply_add};

/// Most full steps before the safeguarded method takes over. Measured on the recorded problems: modes that full steps find at
/// all are found within about ten.
pub(super) const FULL_STEPS: usize = 24;

/// Steps with changing modes after which a few sweeps break the cycle.
const CYCLE: usize = 8;

/// A residual falling at least this much per step lets the old factors serve once more.
const REUSE_CONTRACTION: f64 = 0.02;

/// A regularised step with settled modes should gain at least this much, or `α` hides what is left.
const SLOW: f64 = 0.1;

/// Full Newton steps from `p`; in steady motion two or three of them solve the step.
///
/// The proximal centre stays at the start until the modes settle and follows the iterate then, so that the last steps refine what the
/// regularisation left. `u` is `W p + q` on return; `iterations` is advanced by the linear solves.
pub(super) fn full_steps<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    max_steps: usize,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let mut alpha = options.regularisation * data.mean_diagonal;
    let smallest = 1e-14 * data.mean_diagonal;
    let mut factors = Factors::None;
    let mut allow_symmetric = true;
    let mut exact = false;
    let mut last = f64::INFINITY;
    let mut settled = 0;
    workspace.centre.copy_from_slice(p);
    modes::recall::<D>(data.mu, p, &mut workspace.contacts);
    multiply_add(data.W, p, data.q, u);
    for step in 0.. {
        let residual = data.measure::<D>(&workspace.rho, p, u);
        if Prepared::accepts(options, residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        let progress = residual.relative / last;
        if progress > 0.5
            && residual.relative < 1e-7
            && data.is_within_rounding::<D>(&workspace.rho, p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        if step == max_steps {
            return (SolveStatus::Stalled, residual);
        }
        last = residual.relative;
        let prox = Proximal {
            alpha,
            centre: &workspace.centre,
        };
        let mut prediction = modes::predict::<D>(
            data,
            &workspace.rho_modes,
            prox,
            exact,
            p,
            u,
            &mut workspace.contacts,
        );
        if prediction.changed {
            if !exact {
                exact = true;
                prediction = modes::predict::<D>(
                    data,
                    &workspace.rho_modes,
                    prox,
                    exact,
                    p,
                    u,
                    &mut workspace.contacts,
                );
                prediction.changed = true;
            }
            settled = 0;
            if step > 0 && step % CYCLE == 0 {
                for _ in 0..3 {
                    nsgs::sweep::<D>(data, prox, p);
                }
                multiply_add(data.W, p, data.q, u);
                *iterations += 3;
                last = f64::INFINITY;
                factors = Factors::None;
                continue;
            }
        } else {
            settled += 1;
            workspace.centre.copy_from_slice(p);
        }
        if settled > 1 && progress > SLOW && factors != Factors::None {
            if factors == Factors::Symmetric && allow_symmetric {
                // Perhaps W is not symmetric and half of it is not good enough.
                allow_symmetric = false;
            } else {
                alpha = (0.01 * alpha).max(smallest);
            }
            factors = Factors::None;
        }
        let linear = factors == Factors::Symmetric || !prediction.slides;
        if prediction.changed || (progress > REUSE_CONTRACTION && !linear) {
            factors = Factors::None;
        }
        if factors == Factors::None {
            factors =
                reduced_system::factorise::<D>(data, alpha, prediction, allow_symmetric, workspace);
            if factors == Factors::None && prediction.m > 0 {
                return (SolveStatus::Stalled, residual);
            }
        }
        *iterations += 1;
        reduced_system::newton_point::<D>(
            data,
            alpha,
            prediction.m,
            factors,
            true,
            p,
            u,
            workspace,
        );
        p.copy_from_slice(&workspace.trial);
        multiply_add(data.W, p, data.q, u);
    }
    (SolveStatus::Stalled, Residual::UNSOLVED)
}
