//! The exact solution of one contact: given its 3×3 (or 2×2) block `W` and
//! free velocity `q`, find open, stick or slide.
//!
//! *Open* when `q_N ≥ 0`. *Stick* when `p = −W⁻¹ q` lies in the cone. Otherwise the contact slides:
//! `u_N = 0` and `u_T = −κ p_T` with some `κ > 0`. Eliminating `p_N` leaves, with the Schur
//! complement `Ŵ = W_TT − W_TN W_NT / W_NN` and `q̂ = q_T − W_TN q_N / W_NN`,
//!
//! ```text
//! p_T(κ) = −(Ŵ + κ I)⁻¹ q̂,    p_N(κ) = −(q_N + W_NT p_T(κ)) / W_NN,    |p_T(κ)| = μ p_N(κ).
//! ```
//!
//! At `κ = 0` the left side is larger (no stick), for `κ → ∞` it is smaller (`p_T → 0`,
//! `p_N → −q_N/W_NN > 0`), so a root exists for every `μ`. Multiplied by `det(Ŵ + κI)` it
//! reads `g(κ) = |a + κ q̂| + (μ/W_NN)(q_N det − W_NT·(a + κ q̂)) = 0` with
//! `a = adj(Ŵ) q̂`: a convex norm against a quadratic, solved by Newton kept inside a
//! bracket. Its square is the quartic of Bonnefon and Daviet 2011.

use super::frictionless;
use super::mode::ContactMode;
use crate::cone::tangential_norm;

/// Most steps of the safeguarded Newton on `g(κ)`; bisection alone needs about 60 for all digits.
const MAX_STEPS: usize = 100;

/// Steps of an estimate. With a single one a sweep's directions are too coarse: the loads would
/// depend on the order of the contacts.
const ESTIMATE_STEPS: usize = 2;

/// The solved contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneContactSolution<const D: usize> {
    /// Impulse, N s.
    pub impulse: [f64; D],
    /// Which case of the law holds; without friction a closed contact slides.
    pub mode: ContactMode,
    /// Sliding `u_T = −κ p_T`, 1/kg; zero otherwise and without friction.
    pub kappa: f64,
}

/// Solves a single contact under Coulomb's law and Signorini's condition.
///
/// `W`: block of the Delassus operator, row-major, 1/kg; need not be symmetric, tangential part may
/// be singular. `q`: velocity without this impulse, m/s. `mu`: friction coefficient. Components
/// `[normal, tangent, (tangent)]`. A block with `W_NN ≤ 0` gives a zero impulse.
#[must_use]
pub fn solve_one_contact<const D: usize>(
    W: &[[f64; D]; D],
    q: &[f64; D],
    mu: f64,
) -> OneContactSolution<D> {
    solve_within::<D, MAX_STEPS>(W, q, mu, 0.0)
}

/// Solves a single contact as [`solve_one_contact`] does, but with a slip direction that is
/// accurate to a few digits only. `kappa`: value of the last estimate, or zero.
#[inline]
pub(crate) fn estimate_one_contact<const D: usize>(
    W: &[[f64; D]; D],
    q: &[f64; D],
    mu: f64,
    kappa: f64,
) -> OneContactSolution<D> {
    solve_within::<D, ESTIMATE_STEPS>(W, q, mu, kappa)
}

#[inline]
fn solve_within<const D: usize, const STEPS: usize>(
    W: &[[f64; D]; D],
    q: &[f64; D],
    mu: f64,
    kappa: f64,
) -> OneContactSolution<D> {
    let mut solution = OneContactSolution {
        impulse: [0.0; D],
        mode: ContactMode::Open,
        kappa: 0.0,
    };
    let W_NN = W[0][0];
    if q[0] >= 0.0 || W_NN <= 0.0 {
        return solution;
    }
    solution.impulse = frictionless::answer(W_NN, q);
    if mu <= 0.0 {
        solution.mode = ContactMode::Slip;
    } else if D == 2 {
        in_the_plane(W, q, mu, &mut solution);
    } else {
        in_space::<D, STEPS>(W, q, mu, kappa, &mut solution);
    }
    solution
}

/// Two dimensions: `g` is linear in `κ`, so the slide is explicit.
fn in_the_plane<const D: usize>(
    W: &[[f64; D]; D],
    q: &[f64; D],
    mu: f64,
    solution: &mut OneContactSolution<D>,
) {
    let p = &mut solution.impulse;
    let W_NN = W[0][0];
    let W_hat = (W[1][1] - W[1][0] * W[0][1] / W_NN).max(0.0);
    let q_hat = q[1] - W[1][0] * q[0] / W_NN;
    // g(κ) = |q̂| + (μ/W_NN)(q_N (Ŵ + κ) − W_NT q̂); its root is at Ŵ + κ = the following.
    let stiffness = (q_hat.abs() * W_NN / mu - W[0][1] * q_hat) / -q[0];
    let denominator = W_hat.max(stiffness);
    solution.mode = ContactMode::Stick;
    if denominator > 0.0 {
        p[1] = -q_hat / denominator;
        p[0] = -(q[0] + W[0][1] * p[1]) / W_NN;
    }
    if denominator > W_hat {
        // On the cone exactly, not up to the rounding of the elimination.
        p[1] = (mu * p[0]).copysign(-q_hat);
        solution.mode = ContactMode::Slip;
        solution.kappa = denominator - W_hat;
    }
}

/// A closed contact in space without its normal impulse, which the Schur complement `Ŵ` eliminates.
struct Tangential<'a, const D: usize> {
    W: &'a [[f64; D]; D],
    q: &'a [f64; D],
    mu: f64,
    /// `1/W_NN`.
    inverse: f64,
    q_hat: [f64; 2],
    a: [f64; 2],
    /// Trace of `Ŵ`, 1/kg.
    trace: f64,
    determinant: f64,
    /// `|tr W_TT|`.
    scale: f64,
}

impl<'a, const D: usize> Tangential<'a, D> {
    #[inline]
    fn of(W: &'a [[f64; D]; D], q: &'a [f64; D], mu: f64) -> Self {
        let inverse = 1.0 / W[0][0];
        let mut S = [[0.0; 2]; 2];
        let mut q_hat = [0.0; 2];
        for r in 0..2 {
            for c in 0..2 {
                S[r][c] = W[r + 1][c + 1] - W[r + 1][0] * W[0][c + 1] * inverse;
            }
            q_hat[r] = q[r + 1] - W[r + 1][0] * q[0] * inverse;
        }
        Self {
            W,
            q,
            mu,
            inverse,
            q_hat,
            a: [
                S[1][1] * q_hat[0] - S[0][1] * q_hat[1],
                S[0][0] * q_hat[1] - S[1][0] * q_hat[0],
            ],
            trace: S[0][0] + S[1][1],
            determinant: S[0][0] * S[1][1] - S[0][1] * S[1][0],
            scale: (W[1][1] + W[2][2]).abs(),
        }
    }

    /// Values at one κ: (g, dg/dκ, a + κ q̂, det).
    #[inline]
    fn at(&self, kappa: f64) -> (f64, f64, [f64; 2], f64) {
        let Self {
            W,
            q,
            mu,
            inverse,
            q_hat,
            a,
            trace,
            determinant,
            ..
        } = *self;
        let b = [a[0] + kappa * q_hat[0], a[1] + kappa * q_hat[1]];
        let det = (kappa + trace) * kappa + determinant;
        let norm = (b[0] * b[0] + b[1] * b[1]).sqrt();
        let g = norm + mu * inverse * (q[0] * det - (W[0][1] * b[0] + W[0][2] * b[1]));
        let norm_slope = if norm > 0.0 {
            (b[0] * q_hat[0] + b[1] * q_hat[1]) / norm
        } else {
            0.0
        };
        let slope = norm_slope
            + mu * inverse
                * (q[0] * (2.0 * kappa + trace) - (W[0][1] * q_hat[0] + W[0][2] * q_hat[1]));
        (g, slope, b, det)
    }

    /// The smallest κ of a slide, and the κ of the stick impulse.
    ///
    /// A singular Schur complement leaves the stick impulse undefined: κ is shifted by √ε, which
    /// balances the rounding of a/det against the change of the problem. An indefinite one (from an
    /// unsymmetric W) still has a stick impulse, but slides only above the largest κ with a
    /// vanishing determinant.
    #[inline]
    fn bounds(&self) -> (f64, f64) {
        let Self {
            trace,
            determinant,
            scale,
            ..
        } = *self;
        let is_singular = trace <= 0.0 || determinant <= 1e-13 * trace * trace;
        if !is_singular {
            return (0.0, 0.0);
        }
        let vanishing = 0.5 * ((trace * trace - 4.0 * determinant).max(0.0).sqrt() - trace);
        let smallest = vanishing.max(0.0) + 1e-8 * scale;
        let stick = if vanishing > 1e-8 * scale {
            0.0
        } else {
            smallest
        };
        (smallest, stick)
    }

    /// The impulse for `a + κ q̂` and the determinant.
    #[inline]
    fn impulse(&self, b: [f64; 2], det: f64, p: &mut [f64; D]) {
        let (W, q) = (self.W, self.q);
        for k in 0..2 {
            p[k + 1] = -b[k] / det;
        }
        p[0] = -(q[0] + W[0][1] * p[1] + W[0][2] * p[2]) * self.inverse;
    }

    /// Where the search for κ starts: the answer of an isotropic block, if it is admissible.
    #[inline]
    fn guess(&self, smallest: f64, beside: f64) -> f64 {
        let Self {
            W,
            q,
            mu,
            q_hat,
            trace,
            ..
        } = *self;
        let size = (q_hat[0] * q_hat[0] + q_hat[1] * q_hat[1]).sqrt();
        let along = W[0][1] * q_hat[0] + W[0][2] * q_hat[1];
        let guess = (size * W[0][0] / mu - along / size) / -q[0] - 0.5 * trace;
        if guess > smallest && guess.is_finite() {
            guess
        } else {
            beside
        }
    }
}

fn in_space<const D: usize, const STEPS: usize>(
    W: &[[f64; D]; D],
    q: &[f64; D],
    mu: f64,
    last: f64,
    solution: &mut OneContactSolution<D>,
) {
    let p = &mut solution.impulse;
    let contact = Tangential::of(W, q, mu);
    let (smallest, stick) = contact.bounds();
    let (g, _, b, det) = contact.at(stick);
    if det.abs() > 0.0 {
        contact.impulse(b, det, p);
        // At the boundary of the cone the two tests may differ by rounding.
        if tangential_norm(p) <= mu * p[0] || (det > 0.0 && g <= 0.0 && p[0] > 0.0) {
            solution.mode = ContactMode::Stick;
            return;
        }
    }
    let beside = (smallest + contact.scale).max(f64::MIN_POSITIVE);
    let start = if last > smallest {
        last
    } else {
        contact.guess(smallest, beside)
    };
    // Without a sign change (only if W is indefinite) the contact has no solution; a damped one
    // lets the iteration continue.
    let kappa = if smallest <= 0.0 || contact.at(smallest).0 > 0.0 {
        falling_root::<STEPS>(
            |kappa| {
                let (g, slope, _, _) = contact.at(kappa);
                (g, slope)
            },
            smallest,
            start,
            beside,
        )
    } else {
        start
    };
    let (_, _, b, det) = contact.at(kappa);
    solution.mode = ContactMode::Slip;
    solution.kappa = kappa;
    if det > 0.0 {
        contact.impulse(b, det, p);
        let norm = tangential_norm(p);
        if norm > 0.0 {
            // On the cone exactly.
            let scale = mu * p[0].max(0.0) / norm;
            p[1] *= scale;
            p[2] *= scale;
        }
    }
}

/// Root of a function that is positive at `low` and negative far above it: Newton's method inside a
/// bracket. The search for its upper end starts with the step `reach`.
///
/// `at` gives value and slope.
fn falling_root<const STEPS: usize>(
    at: impl Fn(f64) -> (f64, f64),
    mut low: f64,
    start: f64,
    reach: f64,
) -> f64 {
    let mut high = f64::INFINITY;
    let mut x = start;
    for _ in 0..STEPS {
        let (value, slope) = at(x);
        if value > 0.0 {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let next = if newton >= low && newton <= high {
            newton
        } else if high.is_finite() {
            0.5 * (low + high)
        } else {
            8.0 * low.max(reach)
        };
        let change = (next - x).abs();
        x = next;
        if change <= 4.0 * f64::EPSILON * x {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::coulomb::natural_map;
    use proptest::prelude::*;

    fn violation<const D: usize>(W: &[[f64; D]; D], q: &[f64; D], mu: f64) -> f64 {
        let p = solve_one_contact(W, q, mu).impulse;
        let mut u = *q;
        for r in 0..D {
            for c in 0..D {
                u[r] += W[r][c] * p[c];
            }
        }
        let trace: f64 = (0..D).map(|k| W[k][k]).sum();
        let rho = D as f64 / trace;
        let map = natural_map(&p, &u, mu, rho);
        let size = |v: &[f64; D]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        size(&map) / (rho * size(q) + size(&p))
    }

    /// `G Gᵀ`, plus `skew` to make it unsymmetric; `rank` columns of `G` are kept.
    fn block<const D: usize>(g: &[f64], rank: usize, skew: f64) -> [[f64; D]; D] {
        let mut W = [[0.0; D]; D];
        for r in 0..D {
            for c in 0..D {
                for k in 0..rank {
                    W[r][c] += g[r * 3 + k] * g[c * 3 + k];
                }
            }
        }
        // An antisymmetric part leaves W positive semidefinite.
        for r in 0..D {
            for c in 0..r {
                W[r][c] += skew;
                W[c][r] -= skew;
            }
        }
        W
    }

    #[test]
    fn block_on_a_slope_sticks_below_and_slides_above_the_friction_angle() {
        // m = 2, one step of gravity g h along a slope of angle a: q = g h (−cos a, sin a).
        let W = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]];
        let mu = 0.5_f64;
        for (angle, slides) in [(mu.atan() - 1e-9, false), (mu.atan() + 1e-9, true)] {
            let q = [-angle.cos(), angle.sin() * 0.6, angle.sin() * 0.8];
            let p = solve_one_contact(&W, &q, mu).impulse;
            let speed = (q[1] + 0.5 * p[1]).hypot(q[2] + 0.5 * p[2]);
            let expected = if slides {
                angle.sin() - mu * angle.cos()
            } else {
                0.0
            };
            assert!(
                (speed - expected).abs() < 1e-15,
                "speed {speed}, expected {expected}"
            );
        }
    }

    #[test]
    fn a_block_that_cannot_be_pushed_answers_zero() {
        assert!(
            solve_one_contact(&[[0.0; 3]; 3], &[-1.0, 1.0, 0.0], 0.5)
                .impulse
                .iter()
                .all(|x| x.abs() < 1e-300)
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

        #[test]
        fn obeys_the_law_in_space(
            g in prop::array::uniform9(-1.0..1.0f64),
            q in prop::array::uniform3(-1.0..1.0f64),
            mu in 0.0..1.5f64,
            skew in -1e-3..1e-3f64,
        ) {
            let W = block::<3>(&g, 3, skew);
            prop_assume!(W[0][0] > 1e-3);
            let error = violation(&W, &q, mu);
            // A singular block is solved beside itself, at a distance of 1e-8.
            let volume = (W[0][0] * (W[1][1] * W[2][2] - W[1][2] * W[2][1])
                - W[0][1] * (W[1][0] * W[2][2] - W[1][2] * W[2][0])
                + W[0][2] * (W[1][0] * W[2][1] - W[1][1] * W[2][0]))
                / (W[0][0] * (W[1][1] + W[2][2]).powi(2));
            let bound = if volume > 1e-6 { 1e-9 } else { 1e-5 };
            prop_assert!(error < bound, "{error}");
        }

        #[test]
        fn obeys_the_law_in_the_plane(
            g in prop::array::uniform9(-1.0..1.0f64),
            q in prop::array::uniform2(-1.0..1.0f64),
            mu in 0.0..3.0f64,
        ) {
            let W = block::<2>(&g, 2, 0.0);
            prop_assume!(W[0][0] > 1e-3);
            let error = violation(&W, &q, mu);
            prop_assert!(error < 1e-9, "{error}");
        }

        #[test]
        fn a_rank_two_block_is_solved_too(
            g in prop::array::uniform9(-1.0..1.0f64),
            v in prop::array::uniform3(-1.0..1.0f64),
            mu in 0.0..1.5f64,
        ) {
            let W = block::<3>(&g, 2, 0.0);
            prop_assume!(W[0][0] > 1e-2);
            // A free velocity that impulses can stop.
            let mut q = [0.0; 3];
            for r in 0..3 {
                for c in 0..3 {
                    q[r] += W[r][c] * v[c];
                }
            }
            let error = violation(&W, &q, mu);
            prop_assert!(error < 1e-5, "{error}");
        }
    }
}
