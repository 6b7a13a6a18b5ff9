//! Prediction of the contact modes (open, stick or slide) for a Newton step.
//!
//! There are two predictors, which agree at a solution. The cheap one projects `z = p − ρ û` (Alart
//! and Curnier 1991) and suffices for steady motion. The exact one solves each contact with all
//! others fixed. It uses the whole diagonal block and finds the modes of an impact from rest where
//! the projection cycles (measured: all recorded rover impacts in at most five steps). Neither
//! depends on the order of the contacts.

use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::law::mode::{ContactMode, Tangent};
use crate::law::one_contact::solve_one_contact;
use crate::problem::{Prepared, Proximal};

/// Mode and sliding frame of one contact in the current linearisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::solver) struct Linearised {
    /// Predicted mode.
    pub mode: ContactMode,
    /// Direction of the tangential impulse when sliding.
    pub e: [f64; 2],
    /// Turning stiffness `γ` of the sliding direction, 1/kg; `|u_T|/(μ p_N)` at a solution.
    pub gamma: f64,
    /// First unknown of this contact in the reduced system.
    pub start: usize,
}

/// Result of a prediction of the modes.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::solver) struct Prediction {
    /// Whether any mode differs from the previous prediction.
    pub changed: bool,
    /// Unknowns of the reduced system.
    pub m: usize,
    /// Whether any contact slides with friction.
    pub slides: bool,
}

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

impl Linearised {
    /// The law linearised so, with its first unknown.
    #[inline]
    fn of(tangent: Tangent, start: usize) -> Self {
        let Tangent { mode, e, gamma } = tangent;
        Self {
            mode,
            e,
            gamma,
            start,
        }
    }
}

/// Direction and turning stiffness of a slide at impulse `p` and velocity `u` of one contact.
#[inline]
pub(in crate::solver) fn set_slide<const D: usize>(contact: &mut Linearised, p: &[f64], u: &[f64]) {
    let p: [f64; D] = std::array::from_fn(|k| p[k]);
    let Tangent { e, gamma, .. } = Tangent::sliding(&p, u);
    (contact.e, contact.gamma) = (e, gamma);
}

/// Reads the modes from the impulse itself, the answer of the last step.
///
/// In steady motion these are the modes of the answer, and far better than a prediction from `u`.
/// Wheels that work against each other in a turn slip at 1e-6 m/s, a hundredth of the change of the
/// free velocity from step to step, so `u` does not show the sign of their slip until the modes are
/// right. A contact without impulse counts as sticking if it approaches, else as open.
#[inline]
pub(in crate::solver) fn recall<const D: usize>(
    mu: &[f64],
    p: &[f64],
    u: &[f64],
    contacts: &mut [Linearised],
) -> Prediction {
    let mut prediction = Prediction::default();
    for ((contact, &mu), (p, u)) in contacts
        .iter_mut()
        .zip(mu)
        .zip(p.chunks_exact(D).zip(u.chunks_exact(D)))
    {
        let p: [f64; D] = std::array::from_fn(|k| p[k]);
        *contact = Linearised::of(Coulomb(mu).recall(&p, u), prediction.m);
        prediction.slides |= contact.mode == ContactMode::Slip && mu > 0.0;
        prediction.m += n_unknowns::<D>(contact.mode, mu);
    }
    prediction
}

/// Predicts the modes at `(p, u)`, `u = W p + q`; `contacts` receives them.
/// `exact` chooses the predictor.
#[inline]
pub(in crate::solver) fn predict<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    exact: bool,
    p: &[f64],
    u: &[f64],
    contacts: &mut [Linearised],
) -> Prediction {
    let mut prediction = Prediction::default();
    let alpha = prox.alpha;
    for (i, ((((contact, &mu), &rho), (p, u)), c)) in contacts
        .iter_mut()
        .zip(data.mu)
        .zip(data.modes)
        .zip(p.chunks_exact(D).zip(u.chunks_exact(D)))
        .zip(prox.centre.chunks_exact(D))
        .enumerate()
    {
        let p: [f64; D] = std::array::from_fn(|k| p[k]);
        let u_hat: [f64; D] = std::array::from_fn(|k| u[k] + alpha * (p[k] - c[k]));
        let next = if exact {
            by_solving(data, alpha, i, &p, &u_hat, mu)
        } else {
            Coulomb(mu).linearise(&p, &u_hat, rho)
        };
        prediction.changed |= next.mode != contact.mode;
        prediction.slides |= next.mode == ContactMode::Slip && mu > 0.0;
        *contact = Linearised::of(next, prediction.m);
        prediction.m += n_unknowns::<D>(next.mode, mu);
    }
    prediction
}

fn by_solving<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    i: usize,
    p: &[f64; D],
    u_hat: &[f64; D],
    mu: f64,
) -> Tangent {
    let mut block = data.block::<D>(i);
    let mut q = *u_hat;
    for r in 0..D {
        block[r][r] += alpha;
        for c in 0..D {
            q[r] -= block[r][c] * p[c];
        }
    }
    solve_one_contact(&block, &q, mu).tangent()
}
