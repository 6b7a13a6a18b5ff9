//! The last resort for few contacts: pivoting from other starts.
//!
//! Pivoting follows one path through the modes. Where that path cycles, another often does not. The
//! first start is the best answer so far, whose modes may already be right. The others are
//! pseudorandom impulses of the same size, from a fixed seed.

use super::pivoting;
use crate::problem::Residual;
use crate::scalar::elementary::sin_cos;
use crate::solver::draws::Draws;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};

/// Starts.
const STARTS: usize = 16;

/// Most systems for each start.
const MOST_PIVOTS: usize = 24;

/// Fraction of contacts without load at the start.
const OPEN: f64 = 0.2;

/// Impulses in the cones, of a mean normal impulse `size`.
fn draw<const D: usize>(mu: &[f64], size: f64, draws: &mut Draws, p: &mut [f64]) {
    for (&mu, p) in mu.iter().zip(p.chunks_exact_mut(D)) {
        let is_open = draws.next() < OPEN;
        let normal = 2.0 * size * draws.next();
        // A third of the contacts start on the cone's surface, sliding.
        let tangential = mu.min(1.0) * normal * (1.5 * draws.next()).min(1.0);
        let (sin, cos) = sin_cos(std::f64::consts::TAU * draws.next());
        if is_open {
            p.fill(0.0);
            continue;
        }
        p[0] = normal;
        p[1] = if D == 2 {
            tangential.copysign(cos)
        } else {
            tangential * cos
        };
        if D == 3 {
            p[2] = tangential * sin;
        }
    }
}

/// Pivots from the best answer so far and from others. `u` is `W p + q` on return; `iterations` is
/// advanced by the linear solves.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let mu = attempt.data.mu;
    attempt.p.copy_from_slice(&attempt.scratch.nearest);
    let size = attempt.p.iter().step_by(D).sum::<f64>().max(0.0) / mu.len() as f64;
    let mut draws = Draws(0);
    let mut best = Residual::UNSOLVED;
    for _ in 0..STARTS {
        let found = pivoting::few_pivots(attempt, Some(pivoting::SMALL_ALPHA), MOST_PIVOTS);
        if found.0 == SolveStatus::Converged {
            return found;
        }
        attempt.keep_if_better(found.1, &mut best);
        if attempt.scratch.work.is_exhausted || size <= 0.0 {
            break;
        }
        draw::<D>(mu, size, &mut draws, attempt.p);
    }
    attempt.take_best();
    (SolveStatus::Stalled, attempt.residual())
}
