//! The rules of [pivoting](super::pivoting): how far a step may go, which contact changes its mode,
//! and where its impulse goes.

use crate::cone::tangential_norm;
use crate::law::coulomb::ContactMode;
use crate::problem::Prepared;
use crate::solver::local::modes::Linearised;
use crate::solver::local::one_contact::solve_one_contact;

/// Length of a step, and the contact that limits it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Fraction of the step.
    pub t: f64,
    /// Contact that blocks and the mode it takes.
    pub contact: Option<(usize, ContactMode)>,
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
pub(super) fn ratio_test<const D: usize>(
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

/// The contact that contradicts its mode most at `(p, u)`, and the mode it should take. A
/// [barred](Linearised::is_barred) contact keeps its mode.
pub(super) fn worst_contradiction<const D: usize>(
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
        if amount > worst && !contact.is_barred {
            worst = amount;
            found = Some((i, next));
        }
    }
    found
}

/// Gives contact `i` its new mode, and moves its impulse to where that mode requires it. A contact
/// that closes takes mode and impulse of its own solution with all others fixed, since it may slide
/// at once.
pub(super) fn change_mode<const D: usize>(
    data: &Prepared<'_>,
    (i, mode): (usize, ContactMode),
    contact: &mut Linearised,
    p: &mut [f64],
    u: &[f64],
) {
    let p = &mut p[D * i..][..D];
    let is_closing = contact.mode == ContactMode::Open;
    contact.mode = mode;
    match mode {
        ContactMode::Stick if is_closing => {
            // Its impulse is zero, so that u is its free velocity.
            let q = std::array::from_fn(|k| u[D * i + k]);
            let solved = solve_one_contact::<D>(&data.block(i), &q, data.mu[i]);
            contact.mode = solved.mode;
            p.copy_from_slice(&solved.impulse);
        }
        ContactMode::Open => p.fill(0.0),
        ContactMode::Stick => {}
        ContactMode::Slide => return_to_cone::<D>(data.mu[i], p),
    }
}

/// Turns the friction of the barred contacts against their slip and frees them; false if there are
/// none.
pub(super) fn reverse_barred<const D: usize>(
    mu: &[f64],
    contacts: &mut [Linearised],
    p: &mut [f64],
    u: &[f64],
) -> bool {
    let mut found = false;
    let pairs = p.chunks_exact_mut(D).zip(u.chunks_exact(D));
    for ((contact, &mu), (p, u)) in contacts.iter_mut().zip(mu).zip(pairs) {
        let slip = tangential_norm::<D>(&std::array::from_fn(|k| u[k]));
        if contact.is_barred && slip > 0.0 {
            contact.is_barred = false;
            found = true;
            let scale = -mu * p[0].max(0.0) / slip;
            for (p, u) in p[1..].iter_mut().zip(&u[1..]) {
                *p = scale * u;
            }
        }
    }
    found
}

/// Scales the tangential impulse to `μ p_N`.
pub(super) fn return_to_cone<const D: usize>(mu: f64, p: &mut [f64]) {
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
