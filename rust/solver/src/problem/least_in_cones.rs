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
/// θ is convex with a semismooth gradient. A step solves `Π (P_K'(w) + ε 1) Π δ = −∇θ` for a
/// `δ = Π δ`: with `D = P_K' + ε 1`, which has a block for each contact, `Q D⁻¹ Qᵀ λ = −Q D⁻¹ ∇θ`
/// and `δ = −D⁻¹ (∇θ + Qᵀ λ)`. As ε is proportional to the gradient, rounding leaves 1e-14 of the
/// impulses.
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
    /// Blocks of `D⁻¹`, 3 × 3 of each contact.
    inverses: Vec<[f64; 9]>,
    /// `D⁻¹ Qᵀ` by rows of Q, `Q D⁻¹ Qᵀ` and λ.
    eased: Vec<f64>,
    matrix: Vec<f64>,
    multipliers: Vec<f64>,
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
            self.find_step(touching, (d, n, open), epsilon);
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
        project(touching, d, (&self.w, &self.roots), &mut self.projected);
        for k in 0..n {
            self.step[k] = self.projected[k] - self.least[k];
        }
        for row in self.Q.chunks_exact(n) {
            let along = dot(row, &self.step);
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
        project(touching, d, (w, &self.roots), &mut self.projected);
        let mut value = 0.0;
        for k in 0..n {
            value += 0.5 * self.projected[k] * self.projected[k] - self.least[k] * w[k];
            self.next[k] = self.projected[k] - self.least[k];
        }
        flatten(&self.Q, n, &mut self.next);
        value
    }

    /// Newton's step from `w`.
    fn find_step(
        &mut self,
        touching: &[Touching],
        (d, n, open): (usize, usize, usize),
        epsilon: f64,
    ) {
        self.inverses.clear();
        let (w, roots) = (&self.w, &self.roots);
        let inverses = touching.iter().map(|own| own.inverse(d, w, roots, epsilon));
        self.inverses.extend(inverses);
        self.eased.resize(open * n, 0.0);
        for (q, eased) in (self.Q.chunks_exact(n)).zip(self.eased.chunks_exact_mut(n)) {
            multiply(touching, d, &self.inverses, q, eased);
        }
        multiply(touching, d, &self.inverses, &self.gradient, &mut self.step);
        self.matrix.resize(open * open, 0.0);
        self.multipliers.clear();
        for (f, q) in self.Q.chunks_exact(n).enumerate() {
            for (g, eased) in self.eased.chunks_exact(n).enumerate().take(f + 1) {
                self.matrix[f * open + g] = dot(q, eased);
            }
            self.multipliers.push(dot(q, &self.step));
        }
        cholesky(&mut self.matrix, open);
        forward(&self.matrix, open, &mut self.multipliers);
        backward(&self.matrix, open, &mut self.multipliers);
        for (eased, x) in self.eased.chunks_exact(n).zip(&self.multipliers) {
            for (step, eased) in self.step.iter_mut().zip(eased) {
                *step -= x * eased;
            }
        }
        self.step.iter_mut().for_each(|x| *x = -*x);
        flatten(&self.Q, n, &mut self.step);
    }
}

impl Touching {
    /// Number of the unknowns of a contact.
    fn count(&self, d: usize) -> usize {
        if self.kind == AdmissibleImpulse::Rests {
            d
        } else {
            1
        }
    }

    /// Block of D⁻¹ of a contact, see [`Cones`].
    fn inverse(&self, d: usize, w: &[f64], roots: &[f64], epsilon: f64) -> [f64; 9] {
        let at = self.first;
        let mut inverse = [0.0; 9];
        let slope = match self.kind {
            AdmissibleImpulse::Rests => {
                return inverse_on_cone(self.mu, &w[at..][..d], epsilon);
            }
            AdmissibleImpulse::Slides(_) => f64::from(u8::from(w[at] > 0.0)),
            AdmissibleImpulse::Rubs(most) => f64::from(u8::from(w[at].abs() < most * roots[at])),
        };
        inverse[0] = 1.0 / (slope + epsilon);
        inverse
    }
}

/// `out = D⁻¹ x`.
fn multiply(touching: &[Touching], d: usize, inverses: &[[f64; 9]], x: &[f64], out: &mut [f64]) {
    for (own, inverse) in touching.iter().zip(inverses) {
        let count = own.count(d);
        let unknowns = own.first..own.first + count;
        let (x, out) = (&x[unknowns.clone()], &mut out[unknowns]);
        for (out, row) in out.iter_mut().zip(inverse.chunks_exact(3)) {
            *out = dot(row, x);
        }
    }
}

/// The sum of products of as many numbers as both have.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `x ← Π x`.
fn flatten(Q: &[f64], n: usize, x: &mut [f64]) {
    for row in Q.chunks_exact(n) {
        let along = dot(row, x);
        for (x, q) in x.iter_mut().zip(row) {
            *x -= along * q;
        }
    }
}

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The nearest impulses that the contacts may bear. A contact's unknowns have one weight, so its
/// cone is the same in all units.
fn project(touching: &[Touching], d: usize, (w, roots): (&[f64], &[f64]), out: &mut [f64]) {
    for own in touching {
        let at = own.first;
        match own.kind {
            AdmissibleImpulse::Rests => {
                project_on_cone(own.mu, &w[at..][..d], &mut out[at..][..d]);
            }
            AdmissibleImpulse::Slides(_) => out[at] = w[at].max(0.0),
            AdmissibleImpulse::Rubs(most) => {
                let most = most * roots[at];
                out[at] = w[at].max(-most).min(most);
            }
        }
    }
}

/// Where a point is relative to the cone `|t| ≤ μ n`.
enum Place {
    Inside,
    /// Nearest to the apex.
    Behind,
    /// With its distance from the axis, and the normal component of the nearest point.
    Beside(f64, f64),
}

fn place(mu: f64, w: &[f64]) -> Place {
    let distance = norm(&w[1..]);
    if distance <= mu * w[0] {
        Place::Inside
    } else if mu * distance <= -w[0] {
        Place::Behind
    } else {
        Place::Beside(distance, (w[0] + mu * distance) / (1.0 + mu * mu))
    }
}

/// The nearest point of the cone `|t| ≤ μ n`.
fn project_on_cone(mu: f64, w: &[f64], out: &mut [f64]) {
    match place(mu, w) {
        Place::Inside => out.copy_from_slice(w),
        Place::Behind => out.fill(0.0),
        Place::Beside(distance, normal) => {
            out[0] = normal;
            for (out, w) in out[1..].iter_mut().zip(&w[1..]) {
                *out = mu * normal * (w / distance);
            }
        }
    }
}

/// `(P' + ε 1)⁻¹` of the projection P on the cone. Beside the cone P' has the eigenvalue 1 along
/// its side, 0 across it, and `μ n/|t|` around it.
fn inverse_on_cone(mu: f64, w: &[f64], epsilon: f64) -> [f64; 9] {
    let mut inverse = [0.0; 9];
    let (along, across) = (1.0 / (1.0 + epsilon), 1.0 / epsilon);
    match place(mu, w) {
        Place::Inside => (inverse[0], inverse[4], inverse[8]) = (along, along, along),
        Place::Behind => (inverse[0], inverse[4], inverse[8]) = (across, across, across),
        Place::Beside(distance, normal) => {
            let around = 1.0 / (mu * normal / distance + epsilon);
            let share = 1.0 / (1.0 + mu * mu);
            inverse[0] = share * (along + mu * mu * across);
            for k in 1..w.len() {
                let e = w[k] / distance;
                let both = share * mu * (along - across) * e;
                (inverse[k], inverse[3 * k]) = (both, both);
                for m in 1..w.len() {
                    let radial = e * (w[m] / distance);
                    let other = f64::from(u8::from(k == m)) - radial;
                    inverse[3 * k + m] =
                        share * (mu * mu * along + across) * radial + around * other;
                }
            }
        }
    }
    inverse
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
