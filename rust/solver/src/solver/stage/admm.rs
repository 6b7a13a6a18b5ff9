//! ADMM: alternates a linear solve with a fixed matrix and a projection onto the cones.
//!
//! With `R = σ diag(1/ρ_i)`, where `ρ_i` is the contact's own mass so that mass ratios do not slow
//! the convergence, one iteration reads
//!
//! ```text
//! (W + R) x = R z − y − q − s,    z ← Π_K(x̂ + R⁻¹ y),    y ← y + R (x̂ − z),    s_N = μ|y_T|,
//! ```
//!
//! where `x̂` is the over-relaxed `x`. At a fixed point `y = −ũ`, so De Saxcé's shift `s` is
//! updated from `y` itself. `W + R` is factored once, and again when `σ` changes: `σ` is balanced
//! from time to time so that both residuals fall alike. Without the shift the same iteration solves
//! the convex relaxation of Coulomb's law. The method is a Douglas–Rachford splitting and converges
//! for any `W` whose symmetric part is positive semidefinite, provably so in the convex case.
//! Convergence is linear, which suits moderate tolerances. Source: Boyd et al. 2011; for frictional
//! contact Acary, Brémond and Huber 2018, Carpentier et al. 2024.

use crate::cone::{SecondOrderCone, tangential_norm};
use crate::law::coulomb::modified_velocity;
use crate::problem::{Prepared, Residual};
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, SolveScratch, StageEnd};

/// Initial `σ`, dimensionless; balancing adapts it.
const SIGMA: f64 = 0.1;
/// Over-relaxation.
const RELAXATION: f64 = 1.6;
/// Iterations between two checks of the residual, and between two checks of the balance.
const LOOK: usize = 5;
const BALANCE: usize = 20;
/// Imbalance of the residuals above which `σ` changes, and its largest change.
const IMBALANCE: f64 = 3.0;
const LARGEST_CHANGE: f64 = 10.0;
/// After this many changes `σ` stays fixed, so that balancing cannot prevent convergence.
const MAX_CHANGES: usize = 40;

/// Factors `W + R`; `false` if that fails or the budget does not allow it.
fn factorise<const D: usize>(data: &Prepared<'_>, sigma: f64, scratch: &mut SolveScratch) -> bool {
    let blocks = scratch.system.blocks.chunks_exact_mut(D * D);
    for ((weight, mass), block) in scratch.weights.iter_mut().zip(data.masses).zip(blocks) {
        *weight = 1.0 / mass;
        for (k, entry) in block.iter_mut().enumerate() {
            *entry = if k % (D + 1) == 0 {
                sigma * *weight
            } else {
                0.0
            };
        }
    }
    scratch
        .system
        .factorise_shifted::<D>(data, &mut scratch.work)
}

/// One iteration after the linear solve: over-relaxation, projection, dual step. Squares of the
/// primal and the dual change, in the norm of `R`.
fn project<const D: usize>(
    mu: &[f64],
    sigma: f64,
    weights: &[f64],
    x: &[f64],
    y: &mut [f64],
    z: &mut [f64],
) -> [f64; 2] {
    let mut changes = [0.0; 2];
    for (i, (&mu, weight)) in mu.iter().zip(weights).enumerate() {
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

/// `y = −ũ` of the start with the velocity `u`, `ũ` projected into the dual cone.
fn begin_dual<const D: usize>(mu: &[f64], shifts: bool, u: &[f64], y: &mut [f64]) {
    for (i, &mu) in mu.iter().enumerate() {
        let mut shifted: [f64; D] = std::array::from_fn(|k| u[D * i + k]);
        if shifts {
            shifted = modified_velocity(&shifted, mu);
        }
        let inside = SecondOrderCone::new(mu).dual().project(&shifted);
        for k in 0..D {
            y[D * i + k] = -inside[k];
        }
    }
}

/// `R z − y − q − s`, where `R` is σ times the weights.
#[inline]
fn right_side<const D: usize>(
    data: &Prepared<'_>,
    shifts: bool,
    (sigma, weights): (f64, &[f64]),
    z: &[f64],
    y: &[f64],
    out: &mut [f64],
) {
    for (i, (&mu, weight)) in data.mu.iter().zip(weights).enumerate() {
        let y: [f64; D] = std::array::from_fn(|k| y[D * i + k]);
        for k in 0..D {
            let at = D * i + k;
            out[at] = sigma * weight * z[at] - y[k] - data.q[at];
        }
        if shifts {
            out[D * i] -= mu * tangential_norm(&y);
        }
    }
}

/// The law that ADMM solves: Coulomb's, or another with the same matrix and projection.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct AdmmLaw<M> {
    /// Whether De Saxcé's shift is applied.
    pub shifts: bool,
    /// Residual of `(p, u)` under the law.
    pub measure: M,
    /// Status of an answer within the tolerances.
    pub solved: SolveStatus,
}

/// Alternates from `p` under Coulomb's law. `u` is `W p + q` on return.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let data = attempt.data;
    let law = AdmmLaw {
        shifts: true,
        measure: |p: &[f64], u: &[f64]| data.measure::<D>(p, u),
        solved: SolveStatus::Converged,
    };
    alternate(attempt, &law)
}

/// Alternates from `p` under `law`. `u` is `W p + q` on return, and the
/// residual is Coulomb's under either law.
pub(in crate::solver) fn alternate<const D: usize, M: Fn(&[f64], &[f64]) -> Residual>(
    attempt: &mut Attempt<'_, D>,
    law: &AdmmLaw<M>,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    let mut sigma = SIGMA;
    attempt.find_velocity();
    let dual = &mut attempt.scratch.direction;
    begin_dual::<D>(data.mu, law.shifts, attempt.u, dual);
    if !factorise::<D>(data, sigma, attempt.scratch) {
        return (SolveStatus::Stalled, attempt.residual());
    }
    let mut best = Residual::UNSOLVED;
    attempt.scratch.best.copy_from_slice(attempt.p);
    let (mut step, mut changes_of_sigma) = (0, 0);
    loop {
        if step % LOOK == 0 || step == options.max_sweeps {
            attempt.find_velocity();
            let residual = (law.measure)(attempt.p, attempt.u);
            attempt.scratch.history.note(attempt.iterations, residual);
            if !residual.is_finite() && !best.is_finite() {
                return (SolveStatus::NonFinite, residual);
            }
            attempt.keep_if_better(residual, &mut best);
            let is_solved = options.accepts(residual);
            // A substitution costs about as much as a product.
            let is_spent = !(attempt.scratch.work).affords(LOOK as u64 * 2 * data.product);
            if is_solved || is_spent || step >= options.max_sweeps || !residual.is_finite() {
                attempt.take_best();
                let status = if is_solved {
                    law.solved
                } else {
                    SolveStatus::MaxIterations
                };
                return (status, attempt.residual());
            }
        }
        let SolveScratch {
            system,
            weights,
            direction: dual,
            ..
        } = &mut *attempt.scratch;
        let (z, r) = (&*attempt.p, (sigma, &weights[..]));
        let x = system.solve_shifted::<D>(data, |rhs| {
            right_side::<D>(data, law.shifts, r, z, dual, rhs);
        });
        let [primal, dual] = project::<D>(data.mu, sigma, weights, x, dual, attempt.p);
        step += 1;
        attempt.iterations += 1;
        let ratio = (primal / dual).sqrt();
        let is_unbalanced = ratio.is_finite() && !(1.0 / IMBALANCE..=IMBALANCE).contains(&ratio);
        if step % BALANCE == 0 && is_unbalanced && changes_of_sigma < MAX_CHANGES {
            let change = ratio.clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE);
            let next = (sigma * change).clamp(1e-10, 1e6);
            changes_of_sigma += 1;
            if next.is_finite() && factorise::<D>(data, next, attempt.scratch) {
                sigma = next;
            } else if !factorise::<D>(data, sigma, attempt.scratch) {
                step = options.max_sweeps;
            }
        }
    }
}
