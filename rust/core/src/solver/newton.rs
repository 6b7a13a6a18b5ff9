//! Semismooth Newton on the contact modes.
//!
//! One step predicts each contact's mode from `z = p − ρ û` (Alart and Curnier 1991), with the regularised velocity
//! `û = W p + q + α (p − c)`:
//!
//! - *open* if `z_N ≤ 0`: `p = 0`, no unknown;
//! - *stick* if `|z_T| ≤ μ z_N`: `û = 0`, the impulse's `d` unknowns;
//! - *slide* otherwise, along `e = z_T/|z_T|`, `t = e⊥`: `û_N = 0`, `p_e = μ p_N` and `û_t + γ p_t = 0`, the two unknowns
//!   `(p_N, p_t)` (one in the plane). `γ = (|z_T| − μ z_N)/(ρ μ z_N)` tends to `|u_T|/(μ p_N)`: it is the turning of the sliding
//!   direction, so the step is Newton's and converges quadratically.
//!
//! The linear system has the form `Bᵀ (W + α I) C + γ`, symmetric when nothing slides with friction. `α > 0` with the centre `c`
//! makes it regular when `W` is not: a proximal step, whose answer moves from `c` no farther than `W` asks.

use super::dense;
use super::report::SolveStatus;
use super::workspace::SolverWorkspace;
use super::{SolverOptions, auto::Prepared};
use crate::law::coulomb::ContactMode;
use crate::problem::{Residual, multiply_add};

/// Most full steps before the safeguarded method takes over. Measured on rover steps: an active set that full steps find
/// at all is found within about eight.
pub(super) const FULL_STEPS: usize = 14;

/// A residual falling at least this much per step lets the old factors serve once more.
const REUSE_CONTRACTION: f64 = 0.02;

/// Mode and sliding frame of one contact in the current linearisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Linearised {
    /// Predicted mode.
    pub mode: ContactMode,
    /// Direction of the tangential impulse when sliding.
    pub e: [f64; 2],
    /// `γ`, 1/kg.
    pub gamma: f64,
    /// First unknown of this contact in the reduced system.
    pub start: usize,
}

/// Number of unknowns of a contact.
#[inline]
fn n_unknowns<const D: usize>(mode: ContactMode, mu: f64) -> usize {
    match mode {
        ContactMode::Open => 0,
        ContactMode::Stick => D,
        ContactMode::Slide if D == 3 && mu > 0.0 => 2,
        ContactMode::Slide => 1,
    }
}

/// What a prediction of the modes found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prediction {
    /// Whether any mode differs from the previous prediction.
    pub changed: bool,
    /// Unknowns of the reduced system.
    pub m: usize,
    /// Whether any contact slides.
    pub slides: bool,
}

/// The proximal term `α (p − c)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proximal<'a> {
    /// `α ≥ 0`, 1/kg.
    pub alpha: f64,
    /// Centre `c` (n), N s.
    pub centre: &'a [f64],
}

/// Kept factors of the reduced system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Factors {
    /// None, or outdated.
    None,
    /// Cholesky.
    Symmetric,
    /// LU.
    General,
}

/// Predicts the modes from `z = p − ρ û`; `contacts` receives them.
#[inline]
pub(super) fn predict<const D: usize>(
    data: &Prepared<'_>,
    rho_modes: &[[f64; 2]],
    prox: Proximal<'_>,
    p: &[f64],
    u: &[f64],
    contacts: &mut [Linearised],
) -> Prediction {
    let mut prediction = Prediction {
        changed: false,
        m: 0,
        slides: false,
    };
    let alpha = prox.alpha;
    for ((((contact, &mu), &[rho_N, rho_T]), (p, u)), c) in contacts
        .iter_mut()
        .zip(data.mu)
        .zip(rho_modes)
        .zip(p.chunks_exact(D).zip(u.chunks_exact(D)))
        .zip(prox.centre.chunks_exact(D))
    {
        let z_N = p[0] - rho_N * (u[0] + alpha * (p[0] - c[0]));
        let (mut mode, mut e, mut gamma) = (ContactMode::Open, [0.0; 2], 0.0);
        if z_N > 0.0 {
            let mut z = [0.0; 2];
            for k in 1..D {
                z[k - 1] = p[k] - rho_T * (u[k] + alpha * (p[k] - c[k]));
            }
            let norm = if D == 2 {
                z[0].abs()
            } else {
                (z[0] * z[0] + z[1] * z[1]).sqrt()
            };
            let radius = mu * z_N;
            if mu > 0.0 && norm <= radius {
                mode = ContactMode::Stick;
            } else {
                mode = ContactMode::Slide;
                if mu > 0.0 {
                    e = [z[0] / norm, z[1] / norm];
                    // A contact about to open would have an infinite turning stiffness.
                    gamma = ((norm - radius) / (rho_T * radius)).min(1e12 / rho_T);
                }
            }
        }
        prediction.changed |= mode != contact.mode;
        prediction.slides |= mode == ContactMode::Slide && mu > 0.0;
        *contact = Linearised {
            mode,
            e,
            gamma,
            start: prediction.m,
        };
        prediction.m += n_unknowns::<D>(mode, mu);
    }
    prediction
}

/// Puts `p` where the linearised constraints hold (`p = 0` if open, `p_e = μ p_N` if sliding); says whether that moved
/// it by more than the second order.
#[inline]
fn snap<const D: usize>(mu: &[f64], contacts: &[Linearised], p: &mut [f64]) -> bool {
    let mut moved = false;
    for ((contact, &mu), p) in contacts.iter().zip(mu).zip(p.chunks_exact_mut(D)) {
        match contact.mode {
            ContactMode::Stick => {}
            ContactMode::Open => {
                for x in p {
                    moved |= x.abs() > 0.0;
                    *x = 0.0;
                }
            }
            ContactMode::Slide => {
                let wanted = mu * p[0];
                let along = if D == 2 {
                    p[1] * contact.e[0]
                } else {
                    p[1] * contact.e[0] + p[2] * contact.e[1]
                };
                let gap = wanted - along;
                if gap.abs() > 1e-4 * wanted.abs() {
                    moved = true;
                    if mu > 0.0 {
                        for k in 1..D {
                            p[k] += gap * contact.e[k - 1];
                        }
                    } else {
                        p[1..].fill(0.0);
                    }
                }
            }
        }
    }
    moved
}

/// `Bᵀ (W + α I) C + γ` of the predicted modes, row-major `m × m`.
#[inline]
fn assemble<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    contacts: &[Linearised],
    m: usize,
    row: &mut [f64],
    A: &mut [f64],
) {
    let n = data.n;
    if m == n {
        A[..n * n].copy_from_slice(data.W);
        for k in 0..n {
            A[k * (n + 1)] += alpha;
        }
        return;
    }
    for (i, contact) in contacts.iter().enumerate() {
        let first = &data.W[i * D * n..];
        let size = n_unknowns::<D>(contact.mode, data.mu[i]);
        for k in 0..size {
            let index = contact.start + k;
            let target = &mut A[index * m..(index + 1) * m];
            if contact.mode == ContactMode::Slide && k == 1 {
                let [e0, e1] = contact.e;
                let (a, b) = (&first[n..2 * n], &first[2 * n..3 * n]);
                for ((out, x), y) in row.iter_mut().zip(a).zip(b) {
                    *out = e0 * y - e1 * x;
                }
                combine_columns::<D>(row, data.mu, contacts, target);
                target[index] += contact.gamma;
            } else {
                combine_columns::<D>(&first[k * n..(k + 1) * n], data.mu, contacts, target);
            }
            target[index] += alpha;
        }
    }
}

/// One row of `W C`: the columns that the unknowns of every contact act through.
#[inline]
fn combine_columns<const D: usize>(
    row: &[f64],
    mu: &[f64],
    contacts: &[Linearised],
    target: &mut [f64],
) {
    let mut target = target.iter_mut();
    for ((w, contact), &mu) in row.chunks_exact(D).zip(contacts).zip(mu) {
        match contact.mode {
            ContactMode::Open => {}
            ContactMode::Stick => {
                for (x, out) in w.iter().zip(target.by_ref()) {
                    *out = *x;
                }
            }
            ContactMode::Slide => {
                let [e0, e1] = contact.e;
                let along = if D == 2 {
                    w[1] * e0
                } else {
                    w[1] * e0 + w[2] * e1
                };
                if let Some(out) = target.next() {
                    *out = w[0] + mu * along;
                }
                if D == 3
                    && mu > 0.0
                    && let Some(out) = target.next()
                {
                    *out = e0 * w[2] - e1 * w[1];
                }
            }
        }
    }
}

/// Right-hand side: minus the linearised equations at `(p, û)`.
#[inline]
fn right_hand_side<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    contacts: &[Linearised],
    p: &[f64],
    u: &[f64],
    rhs: &mut [f64],
) {
    for (i, contact) in contacts.iter().enumerate() {
        let mut u_hat = [0.0; D];
        for k in 0..D {
            u_hat[k] = u[D * i + k] + prox.alpha * (p[D * i + k] - prox.centre[D * i + k]);
        }
        match contact.mode {
            ContactMode::Open => {}
            ContactMode::Stick => {
                for k in 0..D {
                    rhs[contact.start + k] = -u_hat[k];
                }
            }
            ContactMode::Slide => {
                rhs[contact.start] = -u_hat[0];
                if D == 3 && data.mu[i] > 0.0 {
                    let [e0, e1] = contact.e;
                    let p_t = e0 * p[D * i + 2] - e1 * p[D * i + 1];
                    rhs[contact.start + 1] =
                        -(e0 * u_hat[D - 1] - e1 * u_hat[1] + contact.gamma * p_t);
                }
            }
        }
    }
}

/// Adds `C y` to `p`. With `on_cone` a sliding impulse returns radially to the cone's surface, a change of second order.
#[inline]
fn apply<const D: usize>(
    mu: &[f64],
    contacts: &[Linearised],
    y: &[f64],
    on_cone: bool,
    p: &mut [f64],
) {
    for ((contact, &mu), p) in contacts.iter().zip(mu).zip(p.chunks_exact_mut(D)) {
        match contact.mode {
            ContactMode::Open => {}
            ContactMode::Stick => {
                for (x, y) in p.iter_mut().zip(&y[contact.start..]) {
                    *x += y;
                }
            }
            ContactMode::Slide => {
                let y_N = y[contact.start];
                p[0] += y_N;
                if mu <= 0.0 {
                    continue;
                }
                let [e0, e1] = contact.e;
                p[1] += mu * y_N * e0;
                if D == 3 {
                    let y_t = y[contact.start + 1];
                    p[1] -= y_t * e1;
                    p[2] += mu * y_N * e1 + y_t * e0;
                }
                if on_cone && p[0] > 0.0 {
                    let norm = crate::cone::tangential_norm::<D>(&std::array::from_fn(|k| p[k]));
                    if norm > 0.0 {
                        let scale = mu * p[0] / norm;
                        for x in &mut p[1..] {
                            *x *= scale;
                        }
                    }
                }
            }
        }
    }
}

/// Factors the reduced system of the predicted modes into the workspace.
#[inline]
pub(super) fn factorise<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    prediction: Prediction,
    allow_symmetric: bool,
    workspace: &mut SolverWorkspace,
) -> Factors {
    let m = prediction.m;
    assemble::<D>(
        data,
        alpha,
        &workspace.contacts,
        m,
        &mut workspace.row,
        &mut workspace.matrix,
    );
    if !prediction.slides && allow_symmetric {
        if dense::cholesky(&mut workspace.matrix[..m * m], m) {
            return Factors::Symmetric;
        }
        assemble::<D>(
            data,
            alpha,
            &workspace.contacts,
            m,
            &mut workspace.row,
            &mut workspace.matrix,
        );
    }
    if dense::lu(&mut workspace.matrix[..m * m], m, &mut workspace.pivots) {
        Factors::General
    } else {
        Factors::None
    }
}

/// Solves the factored reduced system for the workspace's right-hand side, in place.
#[inline]
fn back_substitute(factors: Factors, m: usize, workspace: &mut SolverWorkspace) {
    let rhs = &mut workspace.rhs[..m];
    match factors {
        Factors::None => rhs.fill(0.0),
        Factors::Symmetric => dense::cholesky_solve(&workspace.matrix[..m * m], m, rhs),
        Factors::General => dense::lu_solve(&workspace.matrix[..m * m], m, &workspace.pivots, rhs),
    }
}

/// The Newton point of the regularised problem for the predicted modes and kept factors, from `(p, u)`, into
/// `workspace.trial`.
pub(super) fn newton_point<const D: usize>(
    data: &Prepared<'_>,
    alpha: f64,
    m: usize,
    factors: Factors,
    p: &[f64],
    u: &[f64],
    workspace: &mut SolverWorkspace,
) {
    workspace.trial.copy_from_slice(p);
    let moved = snap::<D>(data.mu, &workspace.contacts, &mut workspace.trial);
    if moved {
        multiply_add(
            data.W,
            &workspace.trial,
            data.q,
            &mut workspace.trial_velocity,
        );
    }
    let u = if moved {
        &workspace.trial_velocity[..]
    } else {
        u
    };
    let prox = Proximal {
        alpha,
        centre: &workspace.centre,
    };
    right_hand_side::<D>(
        data,
        prox,
        &workspace.contacts,
        &workspace.trial,
        u,
        &mut workspace.rhs,
    );
    back_substitute(factors, m, workspace);
    apply::<D>(
        data.mu,
        &workspace.contacts,
        &workspace.rhs,
        false,
        &mut workspace.trial,
    );
}

/// Full Newton steps from `p`; in steady motion two or three of them solve the step.
///
/// The proximal centre follows the iterate while the modes stay, so that the last steps refine what the regularisation left.
/// `u` is `W p + q` on return; `iterations` is advanced by the linear solves.
pub(super) fn full_steps<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    max_steps: usize,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let alpha = options.regularisation * data.mean_diagonal;
    let mut factors = Factors::None;
    let mut allow_symmetric = true;
    let mut last = f64::INFINITY;
    workspace.centre.copy_from_slice(p);
    for contact in &mut workspace.contacts {
        contact.mode = ContactMode::Open;
    }
    multiply_add(data.W, p, data.q, u);
    for step in 0.. {
        let residual = data.measure::<D>(&workspace.rho, p, u);
        if Prepared::accepts(options, residual) {
            return (SolveStatus::Converged, residual);
        }
        if !residual.is_finite() {
            return (SolveStatus::NonFinite, residual);
        }
        let progress = residual.relative / last;
        if progress > 0.5
            && residual.relative < 1e-7
            && data.is_within_rounding::<D>(&workspace.rho, p, u)
        {
            return (SolveStatus::Converged, residual);
        }
        if step == max_steps {
            return (SolveStatus::Stalled, residual);
        }
        last = residual.relative;
        let prox = Proximal {
            alpha,
            centre: &workspace.centre,
        };
        let prediction = predict::<D>(
            data,
            &workspace.rho_modes,
            prox,
            p,
            u,
            &mut workspace.contacts,
        );
        if !prediction.changed {
            workspace.centre.copy_from_slice(p);
        }
        if prediction.changed || factors == Factors::None || progress > REUSE_CONTRACTION {
            if factors == Factors::Symmetric && !prediction.changed {
                if !prediction.slides && progress > 0.1 {
                    // The factors are those of W's symmetric half, and that is not good enough here.
                    allow_symmetric = false;
                    factors = Factors::None;
                }
            } else {
                factors = Factors::None;
            }
            if factors == Factors::None {
                factors = factorise::<D>(data, alpha, prediction, allow_symmetric, workspace);
                if factors == Factors::None && prediction.m > 0 {
                    return (SolveStatus::Stalled, residual);
                }
            }
        }
        *iterations += 1;
        newton_point::<D>(data, alpha, prediction.m, factors, p, u, workspace);
        p.copy_from_slice(&workspace.trial);
        multiply_add(data.W, p, data.q, u);
    }
    (SolveStatus::Stalled, Residual::UNSOLVED)
}
