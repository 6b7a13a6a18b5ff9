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
//! Measured on 3860 solves of a rover steering up a slope of 10 degrees: a median of two systems
//! and 14 at the 99th percentile. Newton on the modes and proximal point needed 600 at the 90th.

use crate::cone::tangential_norm;
use crate::law::coulomb::ContactMode;
use crate::problem::{Prepared, Residual};
use crate::solver::linear::reduced_system::{Factors, NewtonStep};
use crate::solver::local::modes::{self, Linearised, Prediction, n_unknowns};
use crate::solver::options::SolverOptions;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::Scratch;

/// Most systems to solve.
const MAX_PIVOTS: usize = 80;

/// Initial `α` relative to the mean diagonal. It may be small, since the ratio test bounds the
/// impulse in the null space of W.
const ALPHA: f64 = 1e-10;

/// Factor by which `α` shrinks when full steps gain nothing, and the smallest `α`. Wheels squeezed
/// to the limit of friction slip at 1e-11 m/s, and the turning stiffness of such a slide is as
/// small as `α`. Of 749 recorded steps over rocks at 1 ms none was solved with the initial `α`, and
/// nearly all within some ten systems with smaller ones.
const ALPHA_SHRINK: f64 = 0.01;
const SMALLEST_ALPHA: f64 = 1e-14;

/// Least gain of a full step with the same `α`.
const LEAST_GAIN: f64 = 0.5;

/// Length of a step, and the contact that limits it.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Fraction of the step.
    t: f64,
    /// Contact that blocks and the mode it takes.
    contact: Option<(usize, ContactMode)>,
}

/// Smallest `t` in [0, 1] at which `p + t (trial − p)` leaves the cone of a
/// sticking contact; `None` where it stays inside.
fn leaves_cone<const D: usize>(mu: f64, p: &[f64; D], trial: &[f64; D]) -> Option<f64> {
    if p[0] <= 0.0 || tangential_norm(trial) <= mu * trial[0] * (1.0 + 1e-14) {
        return None;
    }
    let d: [f64; D] = std::array::from_fn(|k| trial[k] - p[k]);
    let product = |x: &[f64; D], y: &[f64; D]| {
        let tangential: f64 = x[1..].iter().zip(&y[1..]).map(|(a, b)| a * b).sum();
        tangential - mu * mu * x[0] * y[0]
    };
    // |p_T + t d_T|² = μ² (p_N + t d_N)²
    let (a, b, c) = (product(&d, &d), product(p, &d), product(p, p));
    if c >= 0.0 {
        return (b >= 0.0).then_some(0.0);
    }
    let root = (b * b - a * c).max(0.0).sqrt();
    // c < 0: the smallest positive root, in the form without cancellation.
    let t = if b >= 0.0 {
        -c / (b + root)
    } else {
        (root - b) / a
    };
    let other = if b >= 0.0 {
        (-b - root) / a
    } else {
        -c / (b + root)
    };
    let positive = |x: f64| if x >= 0.0 && x.is_finite() { x } else { 1.0 };
    Some(positive(t).min(positive(other)).min(1.0))
}

/// The ratio test over all contacts.
fn ratio_test<const D: usize>(
    mu: &[f64],
    contacts: &[Linearised],
    p: &[f64],
    trial: &[f64],
) -> Block {
    let mut block = Block {
        t: 1.0,
        contact: None,
    };
    let pairs = p.chunks_exact(D).zip(trial.chunks_exact(D));
    for (i, ((contact, &mu), (p, trial))) in contacts.iter().zip(mu).zip(pairs).enumerate() {
        let p: [f64; D] = std::array::from_fn(|k| p[k]);
        let trial: [f64; D] = std::array::from_fn(|k| trial[k]);
        let (t, next) = match contact.mode {
            ContactMode::Stick => match leaves_cone(mu, &p, &trial) {
                Some(t) => (t, ContactMode::Slide),
                None => continue,
            },
            ContactMode::Slide if trial[0] < 0.0 && p[0] > 0.0 => {
                (p[0] / (p[0] - trial[0]), ContactMode::Open)
            }
            ContactMode::Slide | ContactMode::Open => continue,
        };
        if t < block.t {
            block = Block {
                t,
                contact: Some((i, next)),
            };
        }
    }
    block
}

/// The contact that contradicts its mode most at `(p, u)`, and the mode it should take.
fn worst_contradiction<const D: usize>(
    mu: &[f64],
    contacts: &[Linearised],
    p: &[f64],
    u: &[f64],
) -> Option<(usize, ContactMode)> {
    let mut worst = 0.0;
    let mut found = None;
    let pairs = p.chunks_exact(D).zip(u.chunks_exact(D));
    for (i, ((contact, &mu), (p, u))) in contacts.iter().zip(mu).zip(pairs).enumerate() {
        let p: [f64; D] = std::array::from_fn(|k| p[k]);
        let norm = tangential_norm(&p);
        let (amount, next) = match contact.mode {
            ContactMode::Open => (-u[0], ContactMode::Stick),
            ContactMode::Stick if p[0] < 0.0 => (f64::INFINITY, ContactMode::Open),
            ContactMode::Stick if norm > mu * p[0] * (1.0 + 1e-12) && p[0] > 0.0 => {
                (f64::INFINITY, ContactMode::Slide)
            }
            ContactMode::Slide if norm > 0.0 => {
                // friction that pushes along the slip
                let along: f64 = p[1..].iter().zip(&u[1..]).map(|(p, u)| p * u).sum();
                (along / norm, ContactMode::Stick)
            }
            _ => continue,
        };
        if amount > worst {
            worst = amount;
            found = Some((i, next));
        }
    }
    found
}

/// Gives contact `i` its new mode, and moves its impulse to where that mode requires it.
fn change_mode<const D: usize>(
    mu: f64,
    mode: ContactMode,
    contact: &mut Linearised,
    p: &mut [f64],
) {
    contact.mode = mode;
    match mode {
        ContactMode::Open => p.fill(0.0),
        ContactMode::Stick => {}
        ContactMode::Slide => return_to_cone::<D>(mu, p),
    }
}

/// Scales the tangential impulse to `μ p_N`.
fn return_to_cone<const D: usize>(mu: f64, p: &mut [f64]) {
    let norm = tangential_norm::<D>(&std::array::from_fn(|k| p[k]));
    let scale = if norm > 0.0 {
        mu * p[0].max(0.0) / norm
    } else {
        0.0
    };
    for x in &mut p[1..] {
        *x *= scale;
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

/// Pivots from the warm start `p`. `u` is `W p + q` on return; `iterations`
/// is advanced by the linear solves.
pub(in crate::solver) fn pivots<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut Scratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    data.W.multiply_add(p, data.q, u);
    modes::recall::<D>(data.mu, p, u, &mut scratch.system.contacts);
    let mut alpha = ALPHA * data.mean_diagonal;
    let mut last = f64::INFINITY;
    let mut residual = data.measure::<D>(p, u);
    for _ in 0..MAX_PIVOTS.min(options.max_newton_steps) {
        let prediction = linearise::<D>(data.mu, &mut scratch.system.contacts, p, u);
        scratch.system.centre.copy_from_slice(p);
        *iterations += 1;
        let factors =
            scratch
                .system
                .factorise::<D>(data, alpha, prediction, true, &mut scratch.work);
        if factors == Factors::None && prediction.m > 0 {
            break;
        }
        let newton_step = NewtonStep {
            alpha,
            m: prediction.m,
            factors,
            on_cone: true,
        };
        scratch.system.newton_point::<D>(data, newton_step, p, u);
        let block = ratio_test::<D>(data.mu, &scratch.system.contacts, p, &scratch.system.trial);
        if let Some((i, mode)) = block.contact {
            for (x, trial) in p.iter_mut().zip(&scratch.system.trial) {
                *x += block.t * (trial - *x);
            }
            for ((contact, &mu), p) in scratch
                .system
                .contacts
                .iter()
                .zip(data.mu)
                .zip(p.chunks_exact_mut(D))
            {
                if contact.mode == ContactMode::Slide {
                    return_to_cone::<D>(mu, p);
                }
            }
            change_mode::<D>(
                data.mu[i],
                mode,
                &mut scratch.system.contacts[i],
                &mut p[D * i..][..D],
            );
            data.W.multiply_add(p, data.q, u);
            continue;
        }
        p.copy_from_slice(&scratch.system.trial);
        data.W.multiply_add(p, data.q, u);
        residual = data.measure::<D>(p, u);
        if options.accepts(residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        if residual.relative > LEAST_GAIN * last {
            alpha = (ALPHA_SHRINK * alpha).max(SMALLEST_ALPHA * data.mean_diagonal);
        }
        last = residual.relative;
        if let Some((i, mode)) = worst_contradiction::<D>(data.mu, &scratch.system.contacts, p, u) {
            change_mode::<D>(
                data.mu[i],
                mode,
                &mut scratch.system.contacts[i],
                &mut p[D * i..][..D],
            );
            data.W.multiply_add(p, data.q, u);
        }
    }
    (SolveStatus::Stalled, residual)
}
