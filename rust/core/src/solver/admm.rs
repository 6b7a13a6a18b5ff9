//! ADMM: a linear system with one matrix and a projection on the cones, in turn.
//!
//! With `R = σ diag(1/ρ_i)` (`ρ_i` the contact's own mass, so that a mass ratio does not set the pace) one iteration reads
//!
//! ```text
//! (W + R) x = R z − y − q − s,    z ← Π_K(x̂ + R⁻¹ y),    y ← y + R (x̂ − z),    s_N = μ|y_T|,
//! ```
//!
//! `x̂` being `x` over-relaxed. At rest `y = −ũ`, so De Saxcé's shift `s` is renewed from `y` itself. `W + R` is factored once, and again when
//! `σ` changes: every so often it is balanced so that both residuals fall alike. Without the shift the same iteration solves the convex relaxation of
//! Coulomb's law. Converges for any `W` whose symmetric part is positive semidefinite (it is a Douglas–Rachford splitting), in the convex case provably;
//! linearly, so it is for moderate tolerances. Source: Boyd et al. 2011; for frictional contact Acary, Brémond and Huber 2018, Carpentier et al. 2024.

use super::auto::Prepared;
use super::dense::{self, LANES};
use super::methods::ContactLaw;
use super::modes::Linearised;
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, reduced_system, work};
use crate::cone::{SecondOrderCone, tangential_norm};
use crate::law::coulomb::ContactMode;
use crate::problem::{Operator, Residual};

/// First `σ`, dimensionless; the balance finds the rest.
const SIGMA: f64 = 0.1;
/// Over-relaxation.
const RELAXATION: f64 = 1.6;
/// Iterations between two looks at the residual, and between two looks at the balance.
const LOOK: usize = 5;
const BALANCE: usize = 20;
/// Imbalance of the residuals that changes `σ`, and its largest change.
const IMBALANCE: f64 = 3.0;
const LARGEST_CHANGE: f64 = 10.0;
/// After so many changes `σ` is kept, so that the iteration cannot chase its own balance.
const MAX_CHANGES: usize = 40;

/// Factors `W + R`; `false` where that fails, or the budget does not allow it.
fn factorise<const D: usize>(
    data: &Prepared<'_>,
    sigma: f64,
    workspace: &mut SolverWorkspace,
) -> bool {
    for (weight, rho) in workspace.weights.iter_mut().zip(&workspace.rho) {
        *weight = 1.0 / rho;
    }
    match data.W {
        Operator::Dense(W) => {
            let (n, size) = (data.n, dense::chunks(data.n));
            if !workspace.work.affords(work::dense(n, false)) {
                return false;
            }
            for (i, contact) in workspace.contacts.iter_mut().enumerate() {
                *contact = Linearised {
                    mode: ContactMode::Stick,
                    start: D * i,
                    ..Linearised::default()
                };
            }
            let matrix = &mut workspace.matrix;
            reduced_system::assemble::<D>(data.mu, W, 0.0, &workspace.contacts, n, matrix);
            for k in 0..n {
                matrix[k * size + k / LANES][k % LANES] += sigma * workspace.weights[k / D];
            }
            dense::lu(matrix, size, &mut workspace.pivots)
        }
        Operator::BlockSparse(W) => {
            if !workspace.is_analysed {
                workspace.block_lu.analyse(W);
                workspace.is_analysed = true;
            }
            if !workspace.work.affords(workspace.block_lu.work()) {
                return false;
            }
            workspace.contacts.fill(Linearised {
                mode: ContactMode::Stick,
                ..Linearised::default()
            });
            workspace.block_lu.factorise::<D>(
                W,
                data.mu,
                sigma,
                Some(&workspace.weights),
                &workspace.contacts,
            )
        }
    }
}

/// Residual of `(p, u)` under the relaxed law, in the same two numbers.
fn relaxed_residual<const D: usize>(
    data: &Prepared<'_>,
    rho: &[f64],
    p: &[f64],
    u: &[f64],
) -> Residual {
    let (mut map, mut velocity) = (0.0, 0.0_f64);
    for (i, (&mu, &rho)) in data.mu.iter().zip(rho).enumerate() {
        let z: [f64; D] = std::array::from_fn(|k| p[D * i + k] - rho * u[D * i + k]);
        let projected = SecondOrderCone::new(mu).project(&z);
        let square: f64 = (0..D).map(|k| (p[D * i + k] - projected[k]).powi(2)).sum();
        map += square;
        velocity = velocity.max(square / (rho * rho));
    }
    if map.is_finite() {
        Residual {
            relative: map.sqrt() * data.inverse_data,
            velocity: velocity.sqrt(),
        }
    } else {
        Residual::UNSOLVED
    }
}

/// One iteration after the linear solve: over-relaxation, projection, dual step. Squares of the primal and the dual change, in the norm of `R`.
fn project<const D: usize>(
    data: &Prepared<'_>,
    sigma: f64,
    z: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> [f64; 2] {
    let (x, y) = (workspace.rhs.as_flattened(), &mut workspace.direction);
    let mut changes = [0.0; 2];
    for (i, (&mu, weight)) in data.mu.iter().zip(&workspace.weights).enumerate() {
        let r = sigma * weight;
        let range = D * i..D * (i + 1);
        let (x, y, z) = (&x[range.clone()], &mut y[range.clone()], &mut z[range]);
        let relaxed: [f64; D] =
            std::array::from_fn(|k| RELAXATION * x[k] + (1.0 - RELAXATION) * z[k]);
        let target: [f64; D] = std::array::from_fn(|k| relaxed[k] + y[k] / r);
        let next = SecondOrderCone::new(mu).project(&target);
        for k in 0..D {
            changes[0] += r * (x[k] - next[k]).powi(2);
            changes[1] += r * (next[k] - z[k]).powi(2);
            y[k] += r * (relaxed[k] - next[k]);
        }
        z.copy_from_slice(&next);
    }
    changes
}

/// Iterates from `p` on the given law. `u` is `W p + q` on return, and the residual is Coulomb's under either law.
pub(super) fn solve<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    law: ContactLaw,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let shifts = law == ContactLaw::Coulomb;
    let mut sigma = SIGMA;
    data.W.multiply_add(p, data.q, u);
    // y = −ũ of the start, from inside the dual cone.
    for (i, &mu) in data.mu.iter().enumerate() {
        let mut shifted: [f64; D] = std::array::from_fn(|k| u[D * i + k]);
        if shifts {
            shifted[0] += mu * tangential_norm(&shifted);
        }
        let inside = SecondOrderCone::new(mu).dual().project(&shifted);
        for k in 0..D {
            workspace.direction[D * i + k] = -inside[k];
        }
    }
    if !factorise::<D>(data, sigma, workspace) {
        return (SolveStatus::Stalled, data.measure::<D>(workspace, p, u));
    }
    let mut best = Residual::UNSOLVED;
    workspace.best.copy_from_slice(p);
    let (mut step, mut changes_of_sigma) = (0, 0);
    loop {
        if step % LOOK == 0 || step == options.max_sweeps {
            data.W.multiply_add(p, data.q, u);
            let residual = if shifts {
                data.measure::<D>(workspace, p, u)
            } else {
                relaxed_residual::<D>(data, &workspace.rho, p, u)
            };
            if !residual.is_finite() && !best.is_finite() {
                return (SolveStatus::NonFinite, residual);
            }
            if residual.relative < best.relative {
                best = residual;
                workspace.best.copy_from_slice(p);
            }
            let is_solved = Prepared::accepts(options, residual);
            // A substitution costs about as much as a product.
            let is_spent = !workspace.work.affords(LOOK as u64 * 2 * data.product);
            if is_solved || is_spent || step >= options.max_sweeps || !residual.is_finite() {
                p.copy_from_slice(&workspace.best);
                data.W.multiply_add(p, data.q, u);
                let status = match (is_solved, law) {
                    (false, _) => SolveStatus::MaxIterations,
                    (true, ContactLaw::Coulomb) => SolveStatus::Converged,
                    (true, ContactLaw::Relaxed) => SolveStatus::SolvedRelaxed,
                };
                return (status, data.measure::<D>(workspace, p, u));
            }
        }
        let rhs = workspace.rhs.as_flattened_mut();
        for (i, (&mu, weight)) in data.mu.iter().zip(&workspace.weights).enumerate() {
            let y: [f64; D] = std::array::from_fn(|k| workspace.direction[D * i + k]);
            for k in 0..D {
                let at = D * i + k;
                rhs[at] = sigma * weight * p[at] - y[k] - data.q[at];
            }
            if shifts {
                rhs[D * i] -= mu * tangential_norm(&y);
            }
        }
        rhs[data.n..].fill(0.0);
        match data.W {
            Operator::Dense(_) => dense::lu_solve(
                &workspace.matrix,
                dense::chunks(data.n),
                &workspace.pivots,
                &mut workspace.rhs,
            ),
            Operator::BlockSparse(W) => workspace.block_lu.solve::<D>(W, &mut rhs[..data.n]),
        }
        let [primal, dual] = project::<D>(data, sigma, p, workspace);
        step += 1;
        *iterations += 1;
        let ratio = (primal / dual).sqrt();
        let is_unbalanced = ratio.is_finite() && !(1.0 / IMBALANCE..=IMBALANCE).contains(&ratio);
        if step % BALANCE == 0 && is_unbalanced && changes_of_sigma < MAX_CHANGES {
            let change = ratio.clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE);
            let next = (sigma * change).clamp(1e-10, 1e6);
            changes_of_sigma += 1;
            if next.is_finite() && factorise::<D>(data, next, workspace) {
                sigma = next;
            } else if !factorise::<D>(data, sigma, workspace) {
                step = options.max_sweeps;
            }
        }
    }
}
