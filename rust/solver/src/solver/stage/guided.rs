//! Few contacts from zero impulse: a few sweeps guess the modes, with which Newton starts from
//! zero.
//!
//! Sweeps depend on the order of the contacts. The answer does not, since it takes only modes and
//! slip directions from them. If a mode is ambiguous or the guess was wrong, the stage gives no
//! answer and the caller continues.

use crate::cone::tangential_norm;
use crate::law::mode::{ContactMode, Mode};
use crate::law::one_contact::estimate_one_contact;
use crate::problem::{Operator, Prepared, Residual};
use crate::solver::linear::reduced_system::{Factorisation, NewtonStep};
use crate::solver::local::modes;
use crate::solver::scratch::Attempt;

/// Number of sweeps, and of Newton steps that try their modes.
const SWEEPS: usize = 4;
const STEPS: usize = 6;

/// The old factors are used once more if the residual falls at least by this factor per step.
const REUSE_CONTRACTION: f64 = 0.02;

/// Steps after which the sliding directions are known.
const SETTLED: usize = 1;

/// Smallest gain of a step; with less, the modes count as wrong.
const LEAST_GAIN: f64 = 0.5;

/// Residual below which stagnation may be due to the rounding of `W p + q`.
const ROUNDING_ASKED: f64 = 1e-7;

/// Slip or separation speed, relative to the largest free velocity, that decides a mode.
const DECIDED: f64 = 1e-8;

/// Whether every sliding contact slips and every open one separates. Otherwise a mode is ambiguous.
/// A sweep would choose it by the order of the contacts, on which the loads of a statically
/// indeterminate mechanism would then depend.
fn is_decided<const D: usize>(data: &Prepared<'_>, modes: &[Mode<f64>], u: &[f64]) -> bool {
    let largest = data.q.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    modes
        .iter()
        .zip(u.chunks_exact(D))
        .all(|(mode, u)| match mode.kind() {
            ContactMode::Stick => true,
            ContactMode::Open => u[0] > DECIDED * largest,
            ContactMode::Slip => {
                let slip: [f64; D] = std::array::from_fn(|k| u[k]);
                tangential_norm(&slip) > DECIDED * largest
            }
        })
}

/// One sweep of estimates, contact after contact. `kappas`: stiffness of each contact's slide by
/// the last estimate, 1/kg, or zero.
fn sweep<const D: usize>(data: &Prepared<'_>, W: &[f64], kappas: &mut [f64], p: &mut [f64]) {
    let n = data.n;
    let blocks = W.chunks_exact(D * n).zip(data.q.chunks_exact(D));
    for (i, (((rows, q), &mu), kappa)) in blocks.zip(data.mu).zip(kappas).enumerate() {
        let at = D * i;
        let rows: [&[f64]; D] = std::array::from_fn(|r| &rows[r * n..(r + 1) * n]);
        let mut sums = [[0.0; 2]; D];
        let (pairs, last) = p.as_chunks::<2>();
        for (i, x) in pairs.iter().enumerate() {
            for r in 0..D {
                sums[r][0] += rows[r][2 * i] * x[0];
                sums[r][1] += rows[r][2 * i + 1] * x[1];
            }
        }
        let mut u: [f64; D] = std::array::from_fn(|r| sums[r][0] + sums[r][1] + q[r]);
        if let [x] = last {
            for r in 0..D {
                u[r] += rows[r][n - 1] * x;
            }
        }
        let block: [[f64; D]; D] = rows.map(|row| std::array::from_fn(|c| row[at + c]));
        for r in 0..D {
            for c in 0..D {
                u[r] -= block[r][c] * p[at + c];
            }
        }
        let estimate = estimate_one_contact(&block, &u, mu, *kappa);
        if estimate.impulse.iter().all(|x| x.is_finite()) {
            p[at..at + D].copy_from_slice(&estimate.impulse);
            *kappa = estimate.kappa;
        }
    }
}

/// Solves from `p = 0`; `None` where the modes turn out wrong or undecided. `u` is `W p + q` on
/// return, `iterations` is advanced by sweeps and linear solves.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> Option<Residual> {
    let (data, options) = (attempt.data, attempt.options);
    let Operator::Dense(W) = data.W else {
        return None;
    };
    let system = &mut attempt.scratch.system;
    // The place of the Newton point is free until the first step.
    let kappas = &mut system.trial[..data.mu.len()];
    kappas.fill(0.0);
    for _ in 0..SWEEPS {
        sweep::<D>(data, W, kappas, attempt.p);
    }
    attempt.iterations += SWEEPS;
    data.W.multiply_add(attempt.p, data.q, attempt.u);
    modes::recall::<D>(data.mu, attempt.p, attempt.u, &mut system.modes);
    attempt.p.fill(0.0);
    attempt.u.copy_from_slice(data.q);
    let alpha = options.regularisation * data.mean_diagonal;
    let mut factors = Factorisation::None;
    let mut last = f64::INFINITY;
    system.centre.fill(0.0);
    for step in 0..STEPS.min(options.max_newton_steps) {
        let Attempt { p, u, scratch, .. } = &mut *attempt;
        if factors == Factorisation::None {
            factors = (scratch.system).factorise::<D>(data, alpha, true, &mut scratch.work);
        }
        if factors == Factorisation::None && scratch.system.m > 0 {
            return None;
        }
        // The centre stays at zero until the slip directions are known. Otherwise the guess would
        // remain in the null space of W.
        if step >= SETTLED {
            scratch.system.centre.copy_from_slice(p);
        }
        let newton_step = NewtonStep {
            alpha,
            factors,
            on_cone: true,
        };
        scratch.system.newton_point::<D>(data, newton_step, p, u);
        p.copy_from_slice(&scratch.system.trial);
        attempt.iterations += 1;
        attempt.find_velocity();
        let residual = attempt.measure();
        let progress = residual.relative / last;
        let is_solved = options.accepts(residual)
            || (progress > LEAST_GAIN
                && residual.relative < ROUNDING_ASKED
                && attempt.is_within_rounding());
        let modes = &mut attempt.scratch.system.modes;
        if is_solved {
            return is_decided::<D>(data, modes, attempt.u).then_some(residual);
        }
        if step >= SETTLED && (progress > LEAST_GAIN || progress.is_nan()) {
            return None;
        }
        if progress > REUSE_CONTRACTION {
            factors = Factorisation::None;
        }
        last = residual.relative;
        modes::turn::<D>(data.mu, attempt.p, attempt.u, modes);
    }
    None
}
