//! Prediction of the contact modes (open, stick or slide) for a Newton step.
//!
//! There are two predictors, which agree at a solution. The cheap one projects `z = p − ρ û` (Alart
//! and Curnier 1991) and suffices for steady motion. The exact one solves each contact with all
//! others fixed. It uses the whole diagonal block and finds the modes of an impact from rest where
//! the projection cycles (measured: all recorded rover impacts in at most five steps). Neither
//! depends on the order of the contacts.

use crate::cone::tangential_norm;
use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::law::mode::{self, ContactMode, Mode};
use crate::law::one_contact::solve_one_contact;
use crate::problem::{Prepared, Proximal};

/// Number of unknowns of a contact.
#[inline]
pub(in crate::solver) fn n_unknowns<const D: usize>(mode: ContactMode, mu: f64) -> usize {
    match mode {
        ContactMode::Open => 0,
        ContactMode::Stick => D,
        ContactMode::Slip if D == 3 && mu > 0.0 => 2,
        ContactMode::Slip => 1,
    }
}

/// Turns the sliding contacts along their impulse `p`, at the velocity `u`.
#[inline]
pub(in crate::solver) fn turn<const D: usize>(
    mu: &[f64],
    p: &[f64],
    u: &[f64],
    modes: &mut [Mode<f64>],
) {
    let (p, u) = (p.as_chunks::<D>().0, u.as_chunks::<D>().0);
    for ((mode, &mu), (p, u)) in modes.iter_mut().zip(mu).zip(p.iter().zip(u)) {
        if mode.kind() == ContactMode::Slip {
            *mode = Mode::sliding(mu, p, u);
        }
    }
}

/// Reads the modes from the impulse itself, the answer of the last step.
///
/// In steady motion these are the modes of the answer, and far better than a prediction from `u`.
/// Wheels that work against each other in a turn slip at 1e-6 m/s, a hundredth of the change of the
/// free velocity from step to step, so `u` does not show the sign of their slip until the modes are
/// right.
#[inline]
pub(in crate::solver) fn recall<const D: usize>(
    mu: &[f64],
    p: &[f64],
    u: &[f64],
    modes: &mut [Mode<f64>],
) {
    let (p, u) = (p.as_chunks::<D>().0, u.as_chunks::<D>().0);
    for ((mode, &mu), (p, u)) in modes.iter_mut().zip(mu).zip(p.iter().zip(u)) {
        *mode = match mode::recall(mu, p[0], tangential_norm(p), u[0]) {
            [false, _] => Mode::new(ContactMode::Open),
            [true, true] => Mode::new(ContactMode::Stick),
            [true, false] => Mode::sliding(mu, p, u),
        };
    }
}

/// Predicts the modes at `(p, u)`, `u = W p + q`; `modes` receives them. Returns whether one is
/// another than before. `exact` chooses the predictor.
#[inline]
pub(in crate::solver) fn predict<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    exact: bool,
    p: &[f64],
    u: &[f64],
    modes: &mut [Mode<f64>],
) -> bool {
    let mut changed = false;
    let alpha = prox.alpha;
    for (i, ((((mode, &mu), &rho), (p, u)), c)) in modes
        .iter_mut()
        .zip(data.mu)
        .zip(data.modes)
        .zip(p.as_chunks::<D>().0.iter().zip(u.chunks_exact(D)))
        .zip(prox.centre.chunks_exact(D))
        .enumerate()
    {
        let u_hat: [f64; D] = std::array::from_fn(|k| u[k] + alpha * (p[k] - c[k]));
        let next = if exact {
            by_solving(data, alpha, i, p, &u_hat, mu)
        } else {
            Coulomb(mu).linearise(p, &u_hat, rho)
        };
        changed |= next.kind() != mode.kind();
        *mode = next;
    }
    changed
}

fn by_solving<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    i: usize,
    p: &[f64; D],
    u_hat: &[f64; D],
    mu: f64,
) -> Mode<f64> {
    let mut block = data.block::<D>(i);
    let mut q = *u_hat;
    for r in 0..D {
        block[r][r] += alpha;
        for c in 0..D {
            q[r] -= block[r][c] * p[c];
        }
    }
    let own = solve_one_contact(&block, &q, mu);
    match own.mode {
        ContactMode::Slip => {
            Mode::along(mu, &own.impulse, tangential_norm(&own.impulse), own.kappa)
        }
        mode => Mode::new(mode),
    }
}
