//! [Pivoting](crate::solver::pivoting) on one problem with any number of contacts.
//!
//! Its linear systems are those of Newton's method ([`ReducedSystem`]). In addition it stops where
//! the budget ends, and where the rounding of `W p + q` allows no better answer.
//!
//! Measured on 48 000 general steps of a rover whose torques (up to 0, 60 and 150 N m) and
//! set-points are drawn anew every ten steps, on the plane and among rocks: 3.3 systems on average.

use std::ops::Range;

use crate::law::mode::{ContactMode, Mode};
use crate::law::one_contact::solve_one_contact;
use crate::problem::{ContactScales, Prepared, Residual};
use crate::solver::draws::Draws;
use crate::solver::linear::reduced_system::{Factorisation, NewtonStep, ReducedSystem};
use crate::solver::pivoting::{FURTHER_ALPHAS, Many, NO_GAIN, Pivoting, System, Triple};
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};
use crate::solver::work::WorkBudget;

/// Most systems to solve, unless there are more contacts.
const MAX_PIVOTS: usize = 80;

/// Initial `α` of a start far from the answer.
pub(in crate::solver) const SMALL_ALPHA: f64 = 1e-10;

/// Residual below which a stop of progress may be the rounding of `W p + q`.
const ROUNDING_ASKED: f64 = 1e-7;

/// `α` of the attempts at random in turn, as multiples of the one whose proximal term is the
/// tolerance where an impulse changes by its own size. With that one itself, rounding shifts loads
/// through the null space of `W`; with a larger one, no step gets there.
const ALPHAS_AT_RANDOM: [f64; 2] = [1e4, 1e3];

/// Residual below which an attempt at random continues from the answer of the last.
const CONTINUED: f64 = 1e-4;

/// A prepared problem, its Newton system, and the work that it may take.
struct PreparedSystem<'a, const D: usize> {
    data: &'a Prepared<'a>,
    reduced: &'a mut ReducedSystem,
    work: &'a mut WorkBudget,
    /// Impulses and velocities, `D` a contact.
    p: &'a mut [f64],
    u: &'a mut [f64],
    factors: Factorisation,
    /// Whether the factors have not solved yet: their first solution is paid with them.
    is_fresh: bool,
}

/// Writes the first `D` entries of each contact one after the other.
fn gather<const D: usize>(x: &[Triple<f64>], out: &mut [f64]) {
    for (x, out) in x.iter().zip(out.chunks_exact_mut(D)) {
        out.copy_from_slice(&x[..D]);
    }
}

/// The reverse of [`gather`]; further entries are zero.
fn scatter<const D: usize>(x: &[f64], out: &mut [Triple<f64>]) {
    for (x, out) in x.chunks_exact(D).zip(out) {
        *out = [0.0; 3];
        out[..D].copy_from_slice(x);
    }
}

impl<const D: usize> PreparedSystem<'_, D> {
    /// Writes impulses and velocities to the slices.
    fn show(&mut self, pivoting: &Pivoting<f64, Many>) {
        gather::<D>(&pivoting.p, self.p);
        gather::<D>(&pivoting.u, self.u);
    }

    /// Whether rounding allows no better answer.
    fn is_within_rounding(&mut self, pivoting: &Pivoting<f64, Many>) -> bool {
        self.show(pivoting);
        self.data.is_within_rounding::<D>(self.p, self.u)
    }
}

impl<const D: usize> System<f64, Many> for PreparedSystem<'_, D> {
    type Places = Range<usize>;

    // A system of many contacts costs much more than a correction. Random drives on the plane and
    // among rocks take 12% fewer systems, at as many instructions, than with 1e-6 and one.
    const NEAR: f64 = 1e-10;
    const CORRECTIONS: usize = 4;

    fn places(&self) -> Range<usize> {
        0..self.data.mu.len()
    }

    fn free_velocity(&self, place: usize) -> Triple<f64> {
        let q = &self.data.q[D * place..][..D];
        std::array::from_fn(|k| q.get(k).copied().unwrap_or(0.0))
    }

    fn velocities(&mut self, p: &Vec<Triple<f64>>, u: &mut Vec<Triple<f64>>) {
        gather::<D>(p, self.p);
        self.data.W.multiply_add(self.p, self.data.q, self.u);
        scatter::<D>(self.u, u);
    }

    fn factorise(&mut self, alpha: f64, modes: &Vec<Mode<f64>>) -> bool {
        self.reduced.modes.copy_from_slice(modes);
        self.factors = (self.reduced).factorise::<D>(self.data, alpha, true, self.work);
        self.is_fresh = true;
        self.factors != Factorisation::None || self.reduced.m == 0
    }

    fn solve(&mut self, modes: &Vec<Mode<f64>>, r: &mut Vec<Triple<f64>>) {
        let is_paid = std::mem::take(&mut self.is_fresh);
        if !is_paid && !self.work.affords(2 * self.data.product) {
            r.fill([0.0; 3]);
            return;
        }
        self.reduced.modes.copy_from_slice(modes);
        // Newton's step from impulses and about a centre of zero, where the velocities are −r.
        gather::<D>(r, self.u);
        for u in &mut *self.u {
            *u = -*u;
        }
        self.p.fill(0.0);
        self.reduced.centre.fill(0.0);
        let step = NewtonStep {
            alpha: 0.0,
            factors: self.factors,
            on_cone: false,
        };
        self.reduced
            .newton_point::<D>(self.data, step, self.p, self.u);
        scatter::<D>(&self.reduced.trial, r);
    }

    fn solve_one(
        &self,
        place: usize,
        _: usize,
        free: &Triple<f64>,
        mu: f64,
    ) -> (ContactMode, Triple<f64>) {
        let free = std::array::from_fn(|k| free[k]);
        let own = solve_one_contact::<D>(&self.data.block(place), &free, mu);
        let mut impulse = [0.0; 3];
        impulse[..D].copy_from_slice(&own.impulse);
        (own.mode, impulse)
    }
}

/// Gives `pivoting` a problem, the warm start `p`, and the `α` that is asked for, if any.
fn load<const D: usize>(
    data: &Prepared<'_>,
    alpha: Option<f64>,
    p: &[f64],
    pivoting: &mut Pivoting<f64, Many>,
) {
    pivoting.mean = data.mean_diagonal;
    pivoting.inverses = [data.inverse_speed, data.inverse_data].map(|x| x * x);
    pivoting.asked = alpha.unwrap_or(0.0);
    let scales = data.masses.iter().zip(data.modes);
    for ((law, &mu), (&mass, &modes)) in pivoting.laws.iter_mut().zip(data.mu).zip(scales) {
        law.set(0, mu, ContactScales { mass, modes });
    }
    scatter::<D>(p, &mut pivoting.p);
}

/// Pivots from the warm start `p`, with the given initial `α` relative to the mean diagonal or one
/// that suits the start. `u` is `W p + q` on return; `iterations` is advanced by the steps.
pub(in crate::solver) fn pivots<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    alpha: Option<f64>,
) -> StageEnd {
    let most = MAX_PIVOTS.max(attempt.data.mu.len());
    few_pivots(attempt, alpha, most)
}

/// Pivots as [`pivots`], with at most so many systems.
pub(in crate::solver) fn few_pivots<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    alpha: Option<f64>,
    most: usize,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    let scratch = &mut *attempt.scratch;
    let pivoting = &mut scratch.pivoting;
    load::<D>(data, alpha, attempt.p, pivoting);
    let mut system = PreparedSystem::<D> {
        data,
        reduced: &mut scratch.system,
        work: &mut scratch.work,
        p: attempt.p,
        u: attempt.u,
        factors: Factorisation::None,
        is_fresh: false,
    };
    let tolerances = [options.tolerance, options.velocity_tolerance].map(|x| x * x);
    let most = most.min(options.max_newton_steps);
    pivoting.begin(&mut system, true);
    let mut steps = 0;
    let answer = loop {
        let residual = pivoting.residual_of(0);
        scratch.history.note(attempt.iterations, residual);
        if pivoting.is_solved(tolerances) {
            break (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            break (SolveStatus::NonFinite, residual);
        }
        let stops = pivoting.leaves(NO_GAIN) && residual.relative < ROUNDING_ASKED;
        if stops && system.is_within_rounding(pivoting) {
            break (SolveStatus::Converged, residual);
        }
        if pivoting.lost || steps == most {
            break (SolveStatus::Stalled, residual);
        }
        steps += 1;
        attempt.iterations += 1;
        pivoting.advance(&mut system, true, tolerances);
    };
    system.show(pivoting);
    answer
}

/// Pivots from the start that the scratch keeps, with one of [`FURTHER_ALPHAS`] after the other,
/// and gives the nearest answer. `u` is `W p + q` on return; `iterations` is advanced by the linear
/// solves.
pub(in crate::solver) fn further_pivots<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let mut best: Option<StageEnd> = None;
    for alpha in FURTHER_ALPHAS {
        attempt.p.copy_from_slice(&attempt.scratch.start);
        let found = pivots(attempt, Some(alpha));
        if found.0 == SolveStatus::Converged {
            return found;
        }
        if best.is_none_or(|(_, best)| found.1.relative < best.relative) {
            best = Some(found);
            attempt.scratch.best.copy_from_slice(attempt.p);
        }
    }
    attempt.take_best();
    best.unwrap_or((SolveStatus::Stalled, Residual::UNSOLVED))
}

/// Pivots from `p` in a random order, with at most so many attempts, and gives the nearest answer.
/// `u` is `W p + q` on return; `iterations` is advanced by the linear solves.
///
/// A body may slide on another at more points than hold it, with speeds along the normals that
/// differ by 1e-12 of the slip: some of the points then have to open, and as friction is
/// nonassociated, correcting the worst contradiction first may go in circles.
pub(in crate::solver) fn random_pivots<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    attempts: usize,
) -> StageEnd {
    let (data, options) = (attempt.data, attempt.options);
    let mut best = attempt.residual();
    attempt.scratch.best.copy_from_slice(attempt.p);
    for k in 0..attempts {
        let size = attempt.p.iter().map(|x| x * x).sum::<f64>().sqrt();
        let exact = options.tolerance / (data.inverse_speed * size * data.mean_diagonal);
        let alpha = (ALPHAS_AT_RANDOM[k % 2] * exact).min(1.0);
        attempt.scratch.pivoting.draws = Some(Draws(k as u64));
        let found = pivots(attempt, Some(alpha));
        attempt.scratch.pivoting.draws = None;
        if found.0 == SolveStatus::Converged {
            return found;
        }
        attempt.keep_if_better(found.1, &mut best);
        if attempt.scratch.work.is_exhausted {
            break;
        }
        let is_lost = found.1.relative.is_nan() || found.1.relative > CONTINUED;
        if is_lost {
            attempt.p.copy_from_slice(&attempt.scratch.best);
        }
    }
    attempt.take_best();
    (SolveStatus::Stalled, attempt.residual())
}
