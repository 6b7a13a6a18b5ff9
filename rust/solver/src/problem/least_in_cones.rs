//! The least impulses within the cones, among those that cause the same motion.
//!
//! Newton's method on the dual problem, see [`Cones`]. It runs only where the least impulses
//! without regard to the cones leave one, as those of a box on a steep slope.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

/// Excess over a cone, relative to the largest impulse, that counts as rounding.
pub(super) const ON_THE_CONE: f64 = 1e-13;

/// What a contact may bear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum AdmissibleImpulse {
    /// An impulse in its cone.
    Rests,
    /// A multiple of this unit vector.
    Slides([f64; 3]),
    /// The friction of a joint: at most so much along t.
    Rubs(f64),
}

/// A contact that may bear something, and the first of its unknowns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touching {
    pub(super) contact: usize,
    pub(super) kind: AdmissibleImpulse,
    pub(super) first: usize,
    pub(super) mu: f64,
    pub(super) is_joint: bool,
}

/// Most steps. Tables of five legs near tipping, and boxes on slopes up to the limit of friction,
/// take 3 to 6.
const MAX_STEPS: usize = 60;

/// Most steps in a row that leave more than nine tenths of the slope. Where no impulses in the
/// cones cause the motion θ falls for ever, and the slope stays. Of rovers that fell on their side,
/// 315 searches that found impulses had at most 4 such steps in a row, 181 others 10 to 59.
const MOST_IDLE: usize = 6;

/// The projection of impulses onto the cones and the plane of equal motion.
///
/// In the coordinates `√w y`, with Q orthonormal null vectors (by rows), `Π = 1 − Qᵀ Q` and y' the
/// least impulses without cones, `minimise |y|²` subject to `Π y = y'` and `y` in K has the dual
///
/// ```text
/// minimise  θ(w) = ½ |P_K(w)|² − y'·w   over  w = Π w,      y = P_K(w),   ∇θ = Π (P_K(w) − y')
/// ```
///
/// θ is convex with a semismooth gradient. A step solves `(Π P_K'(w) Π + Qᵀ Q + ε 1) δ = −∇θ`.
#[derive(Clone, Debug, Default)]
pub(super) struct Cones {
    /// Square roots of the weights by unknown.
    pub(super) roots: Vec<f64>,
    pub(super) Q: Vec<f64>,
    least: Vec<f64>,
    w: Vec<f64>,
    trial: Vec<f64>,
    projected: Vec<f64>,
    gradient: Vec<f64>,
    next: Vec<f64>,
    step: Vec<f64>,
    /// Blocks of `P_K'`, 3 × 3 of each contact.
    slopes: Vec<[f64; 9]>,
    matrix: Vec<f64>,
    /// `P_K' Qᵀ` by rows of Q, and what the matrix takes from it.
    sloped: Vec<f64>,
    taken: Vec<f64>,
}

impl Cones {
    /// Moves `y`, the least impulses without cones, to the least within; false if not all the way.
    pub(super) fn minimise(
        &mut self,
        touching: &[Touching],
        (d, n, open): (usize, usize, usize),
        size: f64,
        y: &mut [f64],
    ) -> bool {
        let scale = self.roots.iter().fold(0.0_f64, |most, x| most.max(*x)) * size;
        self.begin(n, y);
        self.slopes.resize(touching.len(), [0.0; 9]);
        let mut value = self.evaluate(touching, d, n, false);
        std::mem::swap(&mut self.gradient, &mut self.next);
        let mut size_of_gradient = norm(&self.gradient);
        let (mut is_found, mut n_idle) = (false, 0);
        for _ in 0..MAX_STEPS {
            is_found = size_of_gradient <= ON_THE_CONE * scale;
            if is_found || n_idle > MOST_IDLE {
                break;
            }
            let epsilon = (1e-2 * size_of_gradient / scale).clamp(1e-14, 1e-4);
            self.set_matrix(touching, (d, n, open), epsilon);
            cholesky(&mut self.matrix, n);
            for (x, g) in self.step.iter_mut().zip(&self.gradient) {
                *x = -g;
            }
            forward(&self.matrix, n, &mut self.step);
            backward(&self.matrix, n, &mut self.step);
            flatten(&self.Q, n, &mut self.step);
            let fall: f64 = (self.gradient.iter().zip(&self.step))
                .map(|(a, b)| a * b)
                .sum();
            let mut share = 1.0;
            let mut goes_on = false;
            for _ in 0..30 {
                for k in 0..n {
                    self.trial[k] = self.w[k] + share * self.step[k];
                }
                let own = self.evaluate(touching, d, n, true);
                let left = norm(&self.next);
                // The value has only half of the digits of its slope.
                if own <= value + 1e-4 * share * fall || left <= 0.5 * size_of_gradient {
                    n_idle = if left > 0.9 * size_of_gradient {
                        n_idle + 1
                    } else {
                        0
                    };
                    (value, size_of_gradient, goes_on) = (own, left, true);
                    break;
                }
                share *= 0.5;
            }
            if !goes_on {
                break;
            }
            std::mem::swap(&mut self.w, &mut self.trial);
            std::mem::swap(&mut self.gradient, &mut self.next);
        }
        // On the plane exactly.
        project(
            touching,
            d,
            (&self.w, &self.roots),
            &mut self.projected,
            None,
        );
        for k in 0..n {
            self.step[k] = self.projected[k] - self.least[k];
        }
        for row in self.Q.chunks_exact(n) {
            let along: f64 = row.iter().zip(&self.step).map(|(a, b)| a * b).sum();
            for (y, q) in self.least.iter_mut().zip(row) {
                *y += along * q;
            }
        }
        for k in 0..n {
            y[k] = self.least[k] / self.roots[k];
        }
        is_found
    }

    /// Makes room for n unknowns and begins at the impulses `y`.
    fn begin(&mut self, n: usize, y: &[f64]) {
        for own in [
            &mut self.least,
            &mut self.w,
            &mut self.trial,
            &mut self.projected,
            &mut self.gradient,
            &mut self.next,
            &mut self.step,
        ] {
            own.clear();
            own.resize(n, 0.0);
        }
        for k in 0..n {
            self.least[k] = self.roots[k] * y[k];
        }
        self.w.copy_from_slice(&self.least);
    }

    /// θ at `w`, or at the trial; its gradient into `next`.
    fn evaluate(&mut self, touching: &[Touching], d: usize, n: usize, of_trial: bool) -> f64 {
        let w = if of_trial { &self.trial } else { &self.w };
        project(touching, d, (w, &self.roots), &mut self.projected, None);
        let mut value = 0.0;
        for k in 0..n {
            value += 0.5 * self.projected[k] * self.projected[k] - self.least[k] * w[k];
            self.next[k] = self.projected[k] - self.least[k];
        }
        flatten(&self.Q, n, &mut self.next);
        value
    }

    /// `Π P_K'(w) Π + Qᵀ Q + ε 1`, its lower triangle.
    fn set_matrix(
        &mut self,
        touching: &[Touching],
        (d, n, open): (usize, usize, usize),
        epsilon: f64,
    ) {
        let slopes = Some(&mut self.slopes[..]);
        project(
            touching,
            d,
            (&self.w, &self.roots),
            &mut self.projected,
            slopes,
        );
        self.matrix.clear();
        self.matrix.resize(n * n, 0.0);
        self.sloped.clear();
        self.sloped.resize(open * n, 0.0);
        for (own, slope) in touching.iter().zip(&self.slopes) {
            let count = if own.kind == AdmissibleImpulse::Rests {
                d
            } else {
                1
            };
            for r in 0..count {
                for c in 0..count {
                    self.matrix[(own.first + r) * n + own.first + c] = slope[3 * r + c];
                    for f in 0..open {
                        let q = self.Q[f * n + own.first + c];
                        self.sloped[f * n + own.first + r] += slope[3 * r + c] * q;
                    }
                }
            }
        }
        // T = S − ½ (Q Sᵀ) Q − ½ Q for the rows S of P' Qᵀ: the matrix is P' + ε 1 − Qᵀ T − Tᵀ Q.
        self.taken.clear();
        self.taken.extend_from_slice(&self.sloped);
        for f in 0..open {
            for g in 0..open {
                let (a, b) = (&self.sloped[f * n..][..n], &self.Q[g * n..][..n]);
                let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let half = 0.5 * (product + f64::from(u8::from(f == g)));
                for (t, q) in self.taken[f * n..][..n].iter_mut().zip(b) {
                    *t -= half * q;
                }
            }
        }
        for (q, t) in self.Q.chunks_exact(n).zip(self.taken.chunks_exact(n)) {
            for i in 0..n {
                let row = &mut self.matrix[i * n..][..=i];
                for ((x, q_j), t_j) in row.iter_mut().zip(q).zip(t) {
                    *x -= q[i] * t_j + t[i] * q_j;
                }
            }
        }
        for k in 0..n {
            self.matrix[k * (n + 1)] += epsilon;
        }
    }
}

/// `x ← Π x`.
fn flatten(Q: &[f64], n: usize, x: &mut [f64]) {
    for row in Q.chunks_exact(n) {
        let along: f64 = row.iter().zip(&*x).map(|(a, b)| a * b).sum();
        for (x, q) in x.iter_mut().zip(row) {
            *x -= along * q;
        }
    }
}

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The nearest impulses that the contacts may bear, and their slopes. A contact's unknowns have one
/// weight, so its cone is the same in all units.
fn project(
    touching: &[Touching],
    d: usize,
    (w, roots): (&[f64], &[f64]),
    out: &mut [f64],
    mut slopes: Option<&mut [[f64; 9]]>,
) {
    for (i, own) in touching.iter().enumerate() {
        let mut slope = [0.0; 9];
        let at = own.first;
        match own.kind {
            AdmissibleImpulse::Rests => {
                slope = project_on_cone(own.mu, &w[at..][..d], &mut out[at..][..d]);
            }
            AdmissibleImpulse::Slides(_) => {
                out[at] = w[at].max(0.0);
                slope[0] = f64::from(u8::from(w[at] > 0.0));
            }
            AdmissibleImpulse::Rubs(most) => {
                let most = most * roots[at];
                out[at] = w[at].max(-most).min(most);
                slope[0] = f64::from(u8::from(w[at].abs() < most));
            }
        }
        if let Some(slopes) = &mut slopes {
            slopes[i] = slope;
        }
    }
}

/// The nearest point of the cone `|t| ≤ μ n`, and the slope of this projection.
fn project_on_cone(mu: f64, w: &[f64], out: &mut [f64]) -> [f64; 9] {
    let mut slope = [0.0; 9];
    let norm = w[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm <= mu * w[0] {
        out.copy_from_slice(w);
        (slope[0], slope[4], slope[8]) = (1.0, 1.0, 1.0);
        return slope;
    }
    if mu * norm <= -w[0] {
        out.fill(0.0);
        return slope;
    }
    let share = 1.0 / (1.0 + mu * mu);
    let normal = (w[0] + mu * norm) * share;
    out[0] = normal;
    slope[0] = share;
    for k in 1..w.len() {
        let e = w[k] / norm;
        out[k] = mu * normal * e;
        (slope[k], slope[3 * k]) = (mu * share * e, mu * share * e);
        for m in 1..w.len() {
            let both = e * (w[m] / norm);
            let across = f64::from(u8::from(k == m)) - both;
            slope[3 * k + m] = mu * mu * share * both + mu * normal / norm * across;
        }
    }
    slope
}

/// Cholesky's factor in place of the lower triangle of a definite matrix.
#[inline(always)]
pub(super) fn cholesky(A: &mut [f64], n: usize) {
    for k in 0..n {
        let (above, own) = A.split_at_mut(k * n);
        for j in 0..k {
            let known: f64 = (own[..j].iter().zip(&above[j * n..]))
                .map(|(a, b)| a * b)
                .sum();
            own[j] = (own[j] - known) / above[j * (n + 1)];
        }
        let known: f64 = own[..k].iter().map(|a| a * a).sum();
        own[k] = (own[k] - known).max(f64::MIN_POSITIVE).sqrt();
    }
}

/// `x ← L⁻¹ x`.
#[inline(always)]
pub(super) fn forward(L: &[f64], n: usize, x: &mut [f64]) {
    for k in 0..n {
        let known: f64 = (L[k * n..][..k].iter().zip(&*x)).map(|(a, b)| a * b).sum();
        x[k] = (x[k] - known) / L[k * (n + 1)];
    }
}

/// `x ← L⁻ᵀ x`.
#[inline(always)]
pub(super) fn backward(L: &[f64], n: usize, x: &mut [f64]) {
    for k in (0..n).rev() {
        let own = x[k] / L[k * (n + 1)];
        x[k] = own;
        for (x, l) in x[..k].iter_mut().zip(&L[k * n..]) {
            *x -= l * own;
        }
    }
}
