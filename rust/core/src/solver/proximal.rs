//! Proximal point around Newton: a sequence of regularised problems, each with one well-behaved answer.
//!
//! The step from the centre `c` solves the problem with `W + α I` and `q − α c`; its fixed points are the solutions of the given
//! problem, and it needs no full rank (Acary, Brémond and Huber 2018, section 8). `α` starts at the size of `W`, where the
//! problem is easy, and shrinks with the centre held at the start, which traces Tikhonov's path to the answer nearest to the start.
//! When a step fails, the last good answer becomes the centre and `α` grows again.
//!
//! Inside: Newton steps with backtracking on the natural map of the regularised problem, and Gauss–Seidel sweeps on the same
//! problem when backtracking fails.

use super::modes::{self, Proximal};
use super::reduced_system::{self, Factors, System};
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, auto::Prepared, nsgs};
use crate::problem::{Residual, multiply_add};

/// Most Newton steps for one value of `α`.
const INNER_STEPS: usize = 30;
/// Shrinking of `α` after a success, growth after a failure.
const SHRINK: f64 = 0.1;
const GROW: f64 = 10.0;
/// Smallest `α` relative to the mean diagonal.
const SMALLEST: f64 = 1e-13;

/// Solves one regularised problem with the centre `workspace.centre`, from `p`; says whether its natural map, relative
/// to the data, fell below `tolerance`. `u = W p + q` on return.
fn inner<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    tolerance: f64,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> bool {
    multiply_add(data.W, p, data.q, u);
    let threshold = (tolerance / data.inverse_data).powi(2);
    let mut stuck = 0;
    for step in 0..INNER_STEPS {
        let prox = Proximal {
            alpha,
            centre: &workspace.centre,
        };
        let current = data.merit::<D>(&workspace.rho, prox, p, u);
        if !current.is_finite() {
            return false;
        }
        if current <= threshold {
            return true;
        }
        let prediction = modes::predict::<D>(
            data,
            &workspace.rho_modes,
            prox,
            true,
            p,
            u,
            &mut workspace.contacts,
        );
        let factors = reduced_system::factorise::<D>(data, alpha, prediction, false, workspace);
        *iterations += 1;
        let mut accepted = false;
        if factors != Factors::None || prediction.m == 0 {
            let system = System {
                alpha,
                m: prediction.m,
                factors,
                on_cone: false,
            };
            reduced_system::newton_point::<D>(data, system, p, u, workspace);
            for ((d, t), x) in workspace
                .direction
                .iter_mut()
                .zip(&workspace.trial)
                .zip(&*p)
            {
                *d = t - x;
            }
            workspace.trial_velocity.fill(0.0);
            multiply_add(
                data.W,
                &workspace.direction,
                &workspace.trial_velocity,
                &mut workspace.image,
            );
            let prox = Proximal {
                alpha,
                centre: &workspace.centre,
            };
            let mut t = 1.0;
            for _ in 0..6 {
                for k in 0..data.n {
                    workspace.trial[k] = p[k] + t * workspace.direction[k];
                    workspace.trial_velocity[k] = u[k] + t * workspace.image[k];
                }
                let value = data.merit::<D>(
                    &workspace.rho,
                    prox,
                    &workspace.trial,
                    &workspace.trial_velocity,
                );
                if value < (1.0 - 1e-3 * t) * current {
                    accepted = true;
                    break;
                }
                t *= 0.5;
            }
            if accepted {
                p.copy_from_slice(&workspace.trial);
                u.copy_from_slice(&workspace.trial_velocity);
                stuck = 0;
            }
        }
        if !accepted {
            if step > 0 && current.sqrt() * data.inverse_data < 1e-13 {
                return true;
            }
            stuck += 1;
            if stuck > 4 {
                return false;
            }
            let prox = Proximal {
                alpha,
                centre: &workspace.centre,
            };
            for _ in 0..10 {
                nsgs::sweep::<D>(data, prox, p);
            }
            multiply_add(data.W, p, data.q, u);
        }
    }
    false
}

/// Proximal point from `p`. `u = W p + q` on return; the best impulse met is returned when nothing converges.
pub(super) fn solve<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    multiply_add(data.W, p, data.q, u);
    let mut best = data.measure::<D>(&workspace.rho, p, u);
    if Prepared::accepts(options, best) {
        return (SolveStatus::Converged, best);
    }
    if !best.is_finite() {
        return (SolveStatus::NonFinite, best);
    }
    workspace.best.copy_from_slice(p);
    workspace.accepted.copy_from_slice(p);
    workspace.centre.copy_from_slice(p);
    let smallest = SMALLEST * data.mean_diagonal;
    let target = options.regularisation * data.mean_diagonal;
    let mut alpha = data.mean_diagonal;
    let mut path = true;
    let mut last = f64::INFINITY;
    let limit = *iterations + options.max_newton_steps;
    let mut status = SolveStatus::MaxIterations;
    let mut failures = 0;
    while *iterations < limit {
        let tolerance = if alpha > target {
            1e-7_f64.min(1e-2 * last)
        } else {
            1e-2 * options.tolerance
        };
        let solved = inner::<D>(data, alpha, tolerance, p, u, workspace, iterations);
        multiply_add(data.W, p, data.q, u);
        let residual = data.measure::<D>(&workspace.rho, p, u);
        if Prepared::accepts(options, residual) {
            return (SolveStatus::Converged, residual);
        }
        if residual.relative < best.relative {
            best = residual;
            workspace.best.copy_from_slice(p);
        }
        if residual.relative < 1e-6 && data.is_within_rounding::<D>(&workspace.rho, p, u) {
            return (SolveStatus::Converged, residual);
        }
        if solved {
            workspace.accepted.copy_from_slice(p);
            if path && alpha > target {
                alpha = (alpha * SHRINK).max(target);
            } else {
                path = false;
                workspace.centre.copy_from_slice(p);
                if residual.relative > 0.1 * last {
                    alpha = (alpha * SHRINK).max(smallest);
                }
            }
            last = residual.relative;
            failures = 0;
        } else {
            failures += 1;
            if failures > 12 {
                status = SolveStatus::Stalled;
                break;
            }
            path = false;
            p.copy_from_slice(&workspace.accepted);
            workspace.centre.copy_from_slice(p);
            alpha = (alpha * GROW).min(100.0 * data.mean_diagonal);
        }
    }
    p.copy_from_slice(&workspace.best);
    multiply_add(data.W, p, data.q, u);
    (status, data.measure::<D>(&workspace.rho, p, u))
}
