//! Pivoting on the contact modes: from a warm start, one contact changes its mode at a time.
//!
//! Full Newton steps change all modes at once and cycle if W is rank deficient: six wheels in a
//! turn work against each other with forces in the null space of W, and a slip of 1e-6 m/s decides
//! which of them slide. Here the impulse moves from the warm start towards the answer of the
//! current modes only as far as all cones allow. The blocking contact then slides (or opens), and
//! the next system is solved. After a full step the contact whose velocity contradicts its mode
//! most is corrected. This is the ratio test of a primal active-set method. It may fail for the
//! nonassociated law; then the caller continues.
//!
//! While the residual falls fast the modes are right, and what contradicts them is the curvature of
//! the slides, which the next step removes: the modes stay. With right modes two or three systems
//! solve a step, as with Newton's method.
//!
//! Two modes may contradict each other at one contact: its friction pushes along its slip, and if
//! it sticks, it leaves the cone at once. Such a contact is barred, so that another one changes its
//! mode. If none is left, its slip has changed its sign, and its friction is reversed.
//!
//! Measured on 19 200 solves of a rover whose torques and set-points are drawn anew every ten
//! steps, on the plane and among rocks: 4.1 systems on average, and one solve in a thousand fails.

use crate::law::coulomb::ContactMode;
use crate::problem::{Prepared, Residual};
use crate::solver::linear::reduced_system::{Factors, NewtonStep};
use crate::solver::local::modes::{self, Linearised, Prediction, n_unknowns};
use crate::solver::options::SolverOptions;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::Scratch;
use crate::solver::stage::pivot_rules::{
    change_mode, ratio_test, return_to_cone, reverse_barred, worst_contradiction,
};

/// Most systems to solve, unless there are more contacts.
const MAX_PIVOTS: usize = 80;

/// Initial `α` relative to the mean diagonal, where something slides and where nothing does. The
/// rounding of `W p + q`, divided by `α`, drifts into the null space of W. The ratio test bounds it
/// where wheels slide, so that `α` may be small there. A parked rover collects it step by step.
const ALPHA: f64 = 1e-8;
const STICKING_ALPHA: f64 = 1e-6;

/// Initial `α` of further attempts from the same start. With a large one each system is a short
/// step of the proximal point method: modes that decide themselves by a slip of 1e-6 m/s change one
/// after the other, where full steps go round in circles. Of 3398 steps of exploring drives that
/// pivoting with the first `α` does not solve, 0.1 solves 2995, 1 then 230 and 0.01 then 62.
pub(crate) const FURTHER_ALPHAS: [f64; 3] = [0.1, 1.0, 0.01];

/// Initial `α` of a start far from the answer.
pub(in crate::solver) const SMALL_ALPHA: f64 = 1e-10;

/// Factor by which `α` shrinks when full steps gain nothing, and the smallest `α`. Wheels squeezed
/// to the limit of friction slip at 1e-11 m/s, and the turning stiffness of such a slide is as
/// small as `α`. Of 749 recorded steps over rocks at 1 ms none was solved with `α` above 1e-10, and
/// nearly all within some ten systems with smaller ones.
const ALPHA_SHRINK: f64 = 1e-3;
const SMALLEST_ALPHA: f64 = 1e-14;

/// Least gain of a full step with the same `α`.
const LEAST_GAIN: f64 = 0.5;

/// A residual falling at least this much keeps the modes for another step. Measured: 0.003 to 0.05
/// cost the same.
const HOLD: f64 = 0.01;

/// Share of the tolerance that the error of old factors may reach in the next step, if they are to
/// serve once more. Measured: 0.01 to 1 cost the same.
const REUSED: f64 = 0.1;

/// Fraction of a step below which the impulse stays where it was.
const NO_MOVE: f64 = 1e-6;

/// Residual below which a stop of progress may be the rounding of `W p + q`.
const ROUNDING_ASKED: f64 = 1e-7;

/// Most reversals of friction.
const REVERSALS: usize = 2;

/// Full steps remembered, and how many may in succession repeat the modes of a remembered one
/// without a smaller residual: more are a cycle.
const MEMORY: usize = 16;
const PATIENCE: usize = 4;

/// The modes of past full steps and the smallest residual with each.
#[derive(Clone, Copy, Debug)]
struct Visits {
    seen: [(u64, f64); MEMORY],
    n: usize,
    /// Full steps since the last with new modes or a smaller residual.
    idle: usize,
}

impl Visits {
    const NONE: Self = Self {
        seen: [(0, 0.0); MEMORY],
        n: 0,
        idle: 0,
    };

    /// Enters a full step.
    fn enter(&mut self, contacts: &[Linearised], residual: f64) {
        // The numbers of 40 contacts are distinct; with more, two that are equal end a solve early.
        let modes = contacts.iter().fold(1_u64, |number, contact| {
            number.wrapping_mul(3).wrapping_add(contact.mode as u64)
        });
        let known = self.n.min(MEMORY);
        self.idle += 1;
        match self.seen[..known].iter_mut().find(|seen| seen.0 == modes) {
            Some(seen) if residual >= LEAST_GAIN * seen.1 => return,
            Some(seen) => seen.1 = residual,
            None => {
                self.seen[self.n % MEMORY] = (modes, residual);
                self.n += 1;
            }
        }
        self.idle = 0;
    }
}

/// State of the iteration from step to step.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Current `α`, 1/kg.
    alpha: f64,
    /// Stored factors, and whether a contact slides with friction, so that they change as it turns.
    factors: Factors,
    slides: bool,
    /// Residual after the last full step.
    last: f64,
    /// Contact that the last full step let stick.
    freed: Option<usize>,
    visits: Visits,
    /// Reversals left.
    reversals: usize,
}

impl Course {
    /// Begins with an `α` (1/kg), a residual and a number of reversals left.
    fn new(alpha: f64, residual: f64, reversals: usize) -> Self {
        Self {
            alpha,
            factors: Factors::None,
            slides: false,
            last: residual,
            freed: None,
            visits: Visits::NONE,
            reversals,
        }
    }

    /// Enters a full step by its residual and its `gain`, the ratio to the residual before, and
    /// decides whether its factors serve once more.
    #[inline]
    fn note(&mut self, contacts: &[Linearised], residual: f64, gain: f64, tolerance: f64) {
        self.last = residual;
        // Factors of a turning slide serve once more if their error then vanishes.
        if gain > LEAST_GAIN || (self.slides && gain * residual > REUSED * tolerance) {
            self.factors = Factors::None;
        }
        self.visits.enter(contacts, residual);
    }

    /// Reverses the friction of barred contacts and begins anew with `alpha`, 1/kg; false if there
    /// is nothing to reverse.
    fn reverse<const D: usize>(
        &mut self,
        data: &Prepared<'_>,
        alpha: f64,
        contacts: &mut [Linearised],
        p: &mut [f64],
        u: &mut [f64],
    ) -> bool {
        if self.reversals == 0 || !reverse_barred::<D>(data.mu, contacts, p, u) {
            return false;
        }
        data.W.multiply_add(p, data.q, u);
        *self = Self::new(alpha, data.measure::<D>(p, u).relative, self.reversals - 1);
        true
    }
}

/// Bars contact `i`, which blocks after the fraction `t` of a step, if the last full step let it
/// stick and it leaves the cone at once; a step that moves ends all bars.
fn bar(contacts: &mut [Linearised], i: usize, t: f64, freed: Option<usize>) {
    if t > NO_MOVE {
        for contact in contacts {
            contact.is_barred = false;
        }
    } else if freed == Some(i) {
        contacts[i].is_barred = true;
    }
}

/// Updates slip directions and stiffnesses at `(p, u)` and numbers the unknowns.
fn linearise<const D: usize>(
    mu: &[f64],
    contacts: &mut [Linearised],
    p: &[f64],
    u: &[f64],
) -> Prediction {
    let mut prediction = Prediction {
        changed: false,
        m: 0,
        slides: false,
    };
    let pairs = p.chunks_exact(D).zip(u.chunks_exact(D));
    for ((contact, &mu), (p, u)) in contacts.iter_mut().zip(mu).zip(pairs) {
        contact.start = prediction.m;
        if contact.mode == ContactMode::Slide {
            modes::set_slide::<D>(contact, p, u);
            prediction.slides |= mu > 0.0;
        }
        prediction.m += n_unknowns::<D>(contact.mode, mu);
    }
    prediction
}

/// The Newton point of the current modes from `(p, u)`, into `trial`; false if the system is
/// singular or the budget does not allow it.
fn newton_point<const D: usize>(
    data: &Prepared<'_>,
    course: &mut Course,
    p: &[f64],
    u: &[f64],
    scratch: &mut Scratch,
) -> bool {
    let prediction = linearise::<D>(data.mu, &mut scratch.system.contacts, p, u);
    scratch.system.centre.copy_from_slice(p);
    let alpha = course.alpha;
    course.slides = prediction.slides;
    if course.factors == Factors::None {
        course.factors =
            scratch
                .system
                .factorise::<D>(data, alpha, prediction, true, &mut scratch.work);
        if course.factors == Factors::None && prediction.m > 0 {
            return false;
        }
    } else if !scratch.work.affords(2 * data.product) {
        return false;
    }
    let step = NewtonStep {
        alpha,
        m: prediction.m,
        factors: course.factors,
        on_cone: true,
    };
    scratch.system.newton_point::<D>(data, step, p, u);
    true
}

/// Moves `p` to where contact `i` blocks, and gives that its new mode.
fn stop_at<const D: usize>(
    data: &Prepared<'_>,
    t: f64,
    (i, mode): (usize, ContactMode),
    p: &mut [f64],
    u: &[f64],
    scratch: &mut Scratch,
) {
    for (x, trial) in p.iter_mut().zip(&scratch.system.trial) {
        *x += t * (trial - *x);
    }
    let contacts = &mut scratch.system.contacts;
    for ((contact, &mu), p) in contacts.iter().zip(data.mu).zip(p.chunks_exact_mut(D)) {
        if contact.mode == ContactMode::Slide {
            return_to_cone::<D>(mu, p);
        }
    }
    change_mode::<D>(data, (i, mode), &mut contacts[i], p, u);
}

/// Pivots from the warm start `p`, with the given initial `α` relative to the mean diagonal or one
/// that suits the start. `u` is `W p + q` on return; `iterations` is advanced by the linear solves.
pub(in crate::solver) fn pivots<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    alpha: Option<f64>,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut Scratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    data.W.multiply_add(p, data.q, u);
    let Prediction { slides, .. } = modes::recall::<D>(data.mu, p, u, &mut scratch.system.contacts);
    let mut residual = data.measure::<D>(p, u);
    scratch.history.note(*iterations, residual);
    if options.accepts(residual) {
        return (SolveStatus::Converged, residual);
    }
    let usual = if slides { ALPHA } else { STICKING_ALPHA };
    let alpha = alpha.unwrap_or(usual) * data.mean_diagonal;
    let mut course = Course::new(alpha, residual.relative, REVERSALS);
    let most = MAX_PIVOTS.max(data.mu.len());
    for _ in 0..most.min(options.max_newton_steps) {
        *iterations += 1;
        let reused = course.factors != Factors::None;
        if !newton_point::<D>(data, &mut course, p, u, scratch) {
            break;
        }
        let contacts = &mut scratch.system.contacts;
        let block = ratio_test::<D>(data.mu, contacts, p, &scratch.system.trial);
        let freed = course.freed.take();
        if let Some((i, mode)) = block.contact {
            bar(contacts, i, block.t, freed);
            stop_at::<D>(data, block.t, (i, mode), p, u, scratch);
            course.factors = Factors::None;
            data.W.multiply_add(p, data.q, u);
            continue;
        }
        p.copy_from_slice(&scratch.system.trial);
        data.W.multiply_add(p, data.q, u);
        residual = data.measure::<D>(p, u);
        scratch.history.note(*iterations, residual);
        if options.accepts(residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        let gain = residual.relative / course.last;
        if gain > LEAST_GAIN
            && residual.relative < ROUNDING_ASKED
            && data.is_within_rounding::<D>(p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        course.note(contacts, residual.relative, gain, options.tolerance);
        if gain < HOLD {
            continue;
        }
        let next = worst_contradiction::<D>(data.mu, contacts, p, u);
        // With the right modes nothing but `α` is left in the way.
        if gain > LEAST_GAIN && !reused && next.is_none() {
            course.alpha = (ALPHA_SHRINK * course.alpha).max(SMALLEST_ALPHA * data.mean_diagonal);
        }
        if course.visits.idle > PATIENCE || (gain > LEAST_GAIN && next.is_none()) {
            if course.reverse::<D>(data, alpha, contacts, p, u) {
                continue;
            }
            if course.visits.idle > PATIENCE {
                break;
            }
        }
        if let Some((i, mode)) = next {
            change_mode::<D>(data, (i, mode), &mut contacts[i], p, u);
            course.factors = Factors::None;
            course.freed = Some(i);
            data.W.multiply_add(p, data.q, u);
        }
    }
    (SolveStatus::Stalled, residual)
}

/// Pivots from the start that the scratch keeps, with one of [`FURTHER_ALPHAS`] after the other,
/// and gives the nearest answer. `u` is `W p + q` on return; `iterations` is advanced by the linear
/// solves.
pub(in crate::solver) fn further_pivots<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut Scratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let mut best: Option<(SolveStatus, Residual)> = None;
    for alpha in FURTHER_ALPHAS {
        p.copy_from_slice(&scratch.start);
        let found = pivots::<D>(data, options, Some(alpha), p, u, scratch, iterations);
        if found.0 == SolveStatus::Converged {
            return found;
        }
        if best.is_none_or(|(_, best)| found.1.relative < best.relative) {
            best = Some(found);
            scratch.best.copy_from_slice(p);
        }
    }
    p.copy_from_slice(&scratch.best);
    data.W.multiply_add(p, data.q, u);
    best.unwrap_or((SolveStatus::Stalled, Residual::UNSOLVED))
}
