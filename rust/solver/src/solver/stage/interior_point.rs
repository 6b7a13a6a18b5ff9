//! Interior point on the friction cones, with De Saxcé's shift inside Newton's step.
//!
//! In the units `x = (μ p_N, p_T)` and `z = (ũ_N / μ, u_T)` both cones are Lorentz's, and the law
//! reads
//!
//! ```text
//! z = D⁻¹ (W p + q) + |z_T| e,    x ∘ z = τ m e,    τ → 0,
//! ```
//!
//! with `D = diag(μ, 1, 1)`, the unit `e = (1, 0, 0)` and the mass `m` of each contact, so that a
//! light contact is as far from its boundary as a heavy one. A step scales the cones as Nesterov
//! and Todd do, which makes of the conditions one block per contact beside `W`; the derivative of
//! the shift `|z_T|` multiplies that block from the left. Predictor and corrector (Mehrotra) share
//! the factors. Without the derivative, with the shift renewed from step to step, the iteration
//! crawls: 7e-3 after 60 steps where this one is at 1e-7 after 14 (`stones_100` of the shelf).
//!
//! Coulomb's law is not monotone, so the path may end before an answer. A step that the cones
//! nearly block is repeated with a proximal term, which is withdrawn once steps are long again.
//!
//! The modes of an answer near the end of the path are clear wherever they can be. The stages after
//! this one take it from there in a few factorisations. Source: Acary et al. 2023; Nesterov and
//! Todd 1998.

use crate::cone::lorentz::{determinant, dot, jordan, tangential, way_out};
use crate::problem::Residual;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};

/// Range of the friction coefficients that the cones take: what lies outside becomes the nearest
/// bound, and the next stage corrects the answer.
const LEAST_FRICTION: f64 = 1e-3;
const MOST_FRICTION: f64 = 1e3;
/// Most steps from one start, and those without a better answer after which the path has ended.
const MOST_STEPS: usize = 60;
const PATIENCE: usize = 8;
/// Residual at which the path ends: rounding of the scaled cones is not far.
const NEAR: f64 = 1e-7;
/// Residual from which the next stage goes on, so that no other start is tried.
const PROMISING: f64 = 1e-5;
/// Least and largest share of `τ` that a step aims at.
const LEAST_CENTRING: f64 = 1e-6;
const MOST_CENTRING: f64 = 0.8;
/// Step below which the proximal term grows tenfold, below which it grows threefold, and above
/// which it shrinks.
const BLOCKED: f64 = 0.1;
const SHORT: f64 = 0.3;
const LONG: f64 = 0.5;
/// Range of the proximal term, relative to the contact's own inverse mass.
const LEAST_PROXIMAL: f64 = 1e-6;
const MOST_PROXIMAL: f64 = 1e2;

/// A start and the share of the way to the boundary that a step takes.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Impulse of the start, relative to the one that stops the contact's mass.
    load: f64,
    share: f64,
}

/// The starts, in their order. Which of them leads to an answer is hardly foreseen: `heap_20_rows`
/// of the shelf needs the second, `stones_460` the third.
const COURSES: [Course; 3] = [
    Course {
        load: 100.0,
        share: 0.9,
    },
    Course {
        load: 10.0,
        share: 0.995,
    },
    Course {
        load: 1.0,
        share: 0.995,
    },
];

/// One contact: its point in both cones, and the step of Newton's method.
#[derive(Clone, Copy, Debug)]
struct Cone<const D: usize> {
    /// μ within its range.
    mu: f64,
    /// Mean diagonal of the contact's block of `D⁻¹ W D⁻¹`, 1/kg: the inverse of its mass `m`.
    stiffness: f64,
    x: [f64; D],
    z: [f64; D],
    /// `z − D⁻¹ (W p + q) − |z_T| e`.
    residual: [f64; D],
    /// Direction of the slip, `z_T / |z_T|`, with a zero first.
    slip: [f64; D],
    /// The scaling's point and its size: `G x = λ = G⁻¹ z`.
    point: [f64; D],
    size: f64,
    lambda: [f64; D],
    /// `det λ`.
    lambda_det: f64,
    /// Right-hand side of the scaled complementarity, solved for `λ`.
    target: [f64; D],
    dx: [f64; D],
    dz: [f64; D],
}

impl<const D: usize> Cone<D> {
    /// At the start of a course. `speed`: of the problem, m/s.
    fn new(mu: f64, block: &[[f64; D]; D], speed: f64, load: f64) -> Self {
        let mu = mu.clamp(LEAST_FRICTION, MOST_FRICTION);
        let sum = block[0][0] / (mu * mu) + (1..D).map(|k| block[k][k]).sum::<f64>();
        let stiffness = if sum > 0.0 { sum / D as f64 } else { 1.0 };
        let unit = |size: f64| std::array::from_fn(|k| if k == 0 { size } else { 0.0 });
        let none = [0.0; D];
        Self {
            mu,
            stiffness,
            x: unit(load * speed / stiffness),
            z: unit(speed),
            residual: none,
            slip: none,
            point: none,
            size: 1.0,
            lambda: none,
            lambda_det: 0.0,
            target: none,
            dx: none,
            dz: none,
        }
    }

    /// Unit of component `k`: `p = x / D`, `u = D z`.
    fn unit(&self, k: usize) -> f64 {
        if k == 0 { self.mu } else { 1.0 }
    }

    /// `τ` of the point, J/kg.
    fn gap(&self) -> f64 {
        dot(&self.x, &self.z) * self.stiffness
    }

    /// Residual, slip and scaling of the point with the velocity `u`; false beyond rounding.
    fn linearise(&mut self, u: &[f64]) -> bool {
        let slip = tangential(&self.z);
        self.residual = std::array::from_fn(|k| self.z[k] - u[k] / self.unit(k));
        self.residual[0] -= slip;
        self.slip = std::array::from_fn(|k| match k {
            0 => 0.0,
            _ if slip > 0.0 => self.z[k] / slip,
            _ => 0.0,
        });
        let (a, b) = (determinant(&self.x), determinant(&self.z));
        if !(a > 0.0 && b > 0.0) {
            return false;
        }
        let (a, b) = (a.sqrt(), b.sqrt());
        let g = (0.5 * (1.0 + dot(&self.x, &self.z) / (a * b))).sqrt();
        self.point = std::array::from_fn(|k| {
            let z = self.z[k] / b;
            (self.x[k] / a + if k == 0 { z } else { -z }) / (2.0 * g)
        });
        self.size = (a / b).sqrt();
        self.lambda = self.forward(&self.z);
        self.lambda_det = a * b;
        self.size.is_finite() && self.size > 0.0 && self.lambda.iter().all(|x| x.is_finite())
    }

    /// `L(sign · w) v`, the scaling's square root without its size.
    fn boost(&self, v: &[f64; D], sign: f64) -> [f64; D] {
        let w = &self.point;
        let along: f64 = sign * (1..D).map(|k| w[k] * v[k]).sum::<f64>();
        let turn = v[0] + along / (1.0 + w[0]);
        std::array::from_fn(|k| match k {
            0 => w[0] * v[0] + along,
            _ => v[k] + sign * w[k] * turn,
        })
    }

    /// From `z` to the scaled space.
    fn forward(&self, v: &[f64; D]) -> [f64; D] {
        self.boost(v, 1.0).map(|x| self.size * x)
    }

    /// From `x` to the scaled space, and from there to `z`.
    fn backward(&self, v: &[f64; D]) -> [f64; D] {
        self.boost(v, -1.0).map(|x| x / self.size)
    }

    /// `(I − e slipᵀ) v`.
    fn shear(&self, mut v: [f64; D]) -> [f64; D] {
        v[0] -= dot(&self.slip, &v);
        v
    }

    /// The contact's block beside `W`, row by row, with a proximal term.
    fn block(&self, proximal: f64, out: &mut [f64]) {
        let reflected: [f64; D] = std::array::from_fn(|k| {
            if k == 0 {
                self.point[0]
            } else {
                -self.point[k]
            }
        });
        for c in 0..D {
            let column = std::array::from_fn(|r| {
                let fixed = match (r == c, r) {
                    (true, 0) => -1.0,
                    (true, _) => 1.0,
                    _ => 0.0,
                };
                (2.0 * reflected[r] * reflected[c] + fixed) / (self.size * self.size)
            });
            let column = self.shear(column);
            for r in 0..D {
                let mut entry = column[r];
                if r == c {
                    entry += proximal * self.stiffness;
                }
                out[D * r + c] = self.unit(r) * entry * self.unit(c);
            }
        }
    }

    /// Right-hand side of Newton's system for the `target`, with a share of the residual.
    fn right_side(&self, share: f64, out: &mut [f64]) {
        let aimed = self.shear(self.backward(&self.target));
        for k in 0..D {
            out[k] = self.unit(k) * (aimed[k] + share * self.residual[k]);
        }
    }

    /// The step of the impulse `dp`.
    fn take_direction(&mut self, dp: &[f64]) {
        self.dx = std::array::from_fn(|k| self.unit(k) * dp[k]);
        let scaled = self.backward(&self.dx);
        self.dz = self.backward(&std::array::from_fn(|k| self.target[k] - scaled[k]));
    }

    /// The longest step that stays in both cones.
    fn way_out(&self) -> f64 {
        way_out(&self.x, &self.dx).min(way_out(&self.z, &self.dz))
    }

    /// The target of the predictor: the boundary.
    fn aim_at_boundary(&mut self) {
        self.target = self.lambda.map(|x| -x);
    }

    /// The target of the corrector: `tau`, less the second-order term of the predictor at the step
    /// `share`.
    fn aim_at(&mut self, tau: f64, share: f64) {
        let bent = jordan(&self.backward(&self.dx), &self.forward(&self.dz));
        let square = jordan(&self.lambda, &self.lambda);
        let mut v: [f64; D] = std::array::from_fn(|k| -square[k] - share * share * bent[k]);
        v[0] += tau / self.stiffness;
        // λ ∘ y = v.
        let l = &self.lambda;
        let across: f64 = (1..D).map(|k| l[k] * v[k]).sum();
        let first = (l[0] * v[0] - across) / self.lambda_det;
        self.target = std::array::from_fn(|k| match k {
            0 => first,
            _ => (v[k] - l[k] * first) / l[0],
        });
    }

    fn advance(&mut self, step: f64) {
        for k in 0..D {
            self.x[k] += step * self.dx[k];
            self.z[k] += step * self.dz[k];
        }
    }
}

/// Mean `τ` after a step.
fn mean_gap<const D: usize>(cones: &[Cone<D>], step: f64) -> f64 {
    let moved = cones.iter().map(|cone| {
        let mut cone = *cone;
        cone.advance(step);
        cone.gap()
    });
    moved.sum::<f64>() / cones.len() as f64
}

/// The longest step that keeps every contact in its cones, at most a whole one; `share` of the way
/// to the boundary.
fn longest<const D: usize>(cones: &[Cone<D>], share: f64) -> f64 {
    cones
        .iter()
        .fold(1.0, |step, cone| step.min(share * cone.way_out()))
}

/// Newton's direction for the targets of the cones.
fn direct<const D: usize>(attempt: &mut Attempt<'_, D>, cones: &mut [Cone<D>], share: f64) {
    let system = &mut attempt.scratch.system;
    let dp = system.solve_shifted::<D>(attempt.data, |rhs| {
        for (cone, rhs) in cones.iter().zip(rhs.chunks_exact_mut(D)) {
            cone.right_side(share, rhs);
        }
    });
    for (cone, dp) in cones.iter_mut().zip(dp.chunks_exact(D)) {
        cone.take_direction(dp);
    }
}

/// One predictor and corrector with the factors at hand; the step's length.
fn take_step<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    cones: &mut [Cone<D>],
    share: f64,
) -> f64 {
    let gap = mean_gap(cones, 0.0);
    cones.iter_mut().for_each(Cone::aim_at_boundary);
    direct(attempt, cones, 1.0);
    let reach = longest(cones, 1.0);
    let mut centring = (mean_gap(cones, reach) / gap).powi(3).max(LEAST_CENTRING);
    if reach < 0.9 {
        centring = centring.max((1.0 - reach).powi(3));
    }
    let centring = centring.min(MOST_CENTRING);
    for cone in &mut *cones {
        cone.aim_at(centring * gap, reach);
    }
    direct(attempt, cones, 1.0 - centring);
    let step = longest(cones, share);
    for cone in cones {
        cone.advance(step);
    }
    step
}

/// The proximal term after a step of this length.
fn revise(proximal: f64, step: f64) -> f64 {
    if step < BLOCKED {
        (10.0 * proximal).clamp(LEAST_PROXIMAL, MOST_PROXIMAL)
    } else if step < SHORT {
        (3.0 * proximal).clamp(LEAST_PROXIMAL, MOST_PROXIMAL)
    } else if step > LONG && proximal > 1e-12 {
        0.1 * proximal
    } else if step > LONG {
        0.0
    } else {
        proximal
    }
}

/// Follows one course. The best impulse and its residual are in `scratch.best` and `best`.
fn follow<const D: usize>(attempt: &mut Attempt<'_, D>, course: Course, best: &mut Residual) {
    let data = attempt.data;
    let speed = data.q.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut cones: Vec<Cone<D>> = (0..data.mu.len())
        .map(|i| Cone::new(data.mu[i], &data.block::<D>(i), speed, course.load))
        .collect();
    let (mut nearest, mut since) = (f64::INFINITY, 0);
    let (mut proximal, mut step) = (0.0, 1.0);
    for _ in 0..MOST_STEPS {
        for (cone, p) in cones.iter().zip(attempt.p.chunks_exact_mut(D)) {
            for (k, p) in p.iter_mut().enumerate() {
                *p = cone.x[k] / cone.unit(k);
            }
        }
        attempt.find_velocity();
        let residual = attempt.measure();
        attempt.keep_if_better(residual, best);
        since += 1;
        if residual.relative < nearest {
            (nearest, since) = (residual.relative, 0);
        }
        let has_ended = since > PATIENCE || !residual.is_finite();
        let is_near = residual.relative <= NEAR || attempt.options.accepts(residual);
        let contacts = cones.iter_mut().zip(attempt.u.chunks_exact(D));
        if has_ended || is_near || !contacts.into_iter().all(|(cone, u)| cone.linearise(u)) {
            return;
        }
        proximal = revise(proximal, step);
        let scratch = &mut *attempt.scratch;
        let blocks = scratch.system.blocks.chunks_exact_mut(D * D);
        for (cone, block) in cones.iter().zip(blocks) {
            cone.block(proximal, block);
        }
        attempt.iterations += 1;
        // Two substitutions, and the product above.
        if !scratch.work.affords(6 * data.product)
            || !(scratch.system).factorise_shifted::<D>(data, &mut scratch.work)
        {
            return;
        }
        step = take_step(attempt, &mut cones, course.share);
    }
}

/// Follows the path to the answer from one start after the other; none is `p`. `u` is `W p + q` on
/// return, and `p` the best impulse found, mostly within 1e-6 and hardly ever within the tolerance.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    attempt.find_velocity();
    let mut best = attempt.residual();
    attempt.scratch.best.copy_from_slice(attempt.p);
    for course in COURSES {
        follow(attempt, course, &mut best);
        if best.relative <= PROMISING || attempt.scratch.work.is_exhausted {
            break;
        }
    }
    attempt.take_best();
    let residual = attempt.residual();
    let status = if attempt.options.accepts(residual) {
        SolveStatus::Converged
    } else {
        SolveStatus::Stalled
    };
    (status, residual)
}
