//! The linear system of a Newton step on `C` contacts: product with `W`, assembly, LU.
//!
//! Each contact has three unknowns whatever its mode; those that a mode eliminates have a row of
//! the unit matrix and the answer zero. With the columns `C_i` and rows `B_i` of the
//! [modes](Mode) the system is
//!
//! ```text
//! Bᵀ (W + α I) C y + γ y = −Bᵀ (q − α c),    p = C y
//! ```
//!
//! It gives the impulses themselves, not a change of them: the error of an LU is small in the
//! equations, whatever the condition of `W + α I`. Rows are not exchanged; that leaves the number
//! of steps as it is.

use super::loaded::{Loaded, solve_one};
use super::problem::{ContactProblem, MAX_DENSE, block};
use crate::law::mode::{ContactMode, Mode};
use crate::scalar::{Lane, MAX_LANES};
use crate::solver::pivoting::{Few, System, Triple};

/// A 3 x 3 block, row-major.
pub(super) type ContactBlock<T> = [T; 9];

/// Block (i, j) of a symmetric `W`.
#[inline(always)]
fn block_of<T: Lane, const B: usize>(
    W: &[ContactBlock<T>; B],
    i: usize,
    j: usize,
) -> ContactBlock<T> {
    if j <= i {
        W[block(i, j)]
    } else {
        let [a, b, c, d, e, f, g, h, k] = W[block(j, i)];
        [a, d, g, b, e, h, c, f, k]
    }
}

/// `u = W p + q` at the first n places.
#[inline(always)]
pub(super) fn velocities<T: Lane, const C: usize, const B: usize>(
    W: &[ContactBlock<T>; B],
    n: usize,
    q: &[Triple<T>; C],
    p: &[Triple<T>; C],
    u: &mut [Triple<T>; C],
) {
    *u = *q;
    for i in 0..n {
        let [p0, p1, p2] = p[i];
        let mut own = u[i];
        for j in 0..i {
            let w = &W[block(i, j)];
            let other = p[j];
            for k in 0..3 {
                let row = &w[3 * k..3 * k + 3];
                own[k] += row[0] * other[0] + row[1] * other[1] + row[2] * other[2];
                u[j][k] += w[k] * p0 + w[3 + k] * p1 + w[6 + k] * p2;
            }
        }
        let w = &W[block(i, i)];
        for k in 0..3 {
            let row = &w[3 * k..3 * k + 3];
            own[k] += row[0] * p0 + row[1] * p1 + row[2] * p2;
        }
        u[i] = own;
    }
}

/// Block (i, j) of `Bᵀ (W + α I) C + γ`.
#[inline(always)]
fn assemble<T: Lane>(
    w: ContactBlock<T>,
    alpha: Option<T>,
    row_mode: &Mode<T>,
    column_mode: &Mode<T>,
) -> ContactBlock<T> {
    let mut w = w;
    if let Some(alpha) = alpha {
        for k in 0..3 {
            w[4 * k] += alpha;
        }
    }
    let Mode { a, b, .. } = column_mode;
    let mut x = w;
    for k in 0..3 {
        let (w1, w2) = (w[3 * k + 1], w[3 * k + 2]);
        x[3 * k] = w[3 * k] + (a[0] * w1 + a[1] * w2);
        x[3 * k + 1] = b[0] * w1 + b[1] * w2;
    }
    let Mode {
        closed,
        b,
        stick,
        gamma,
        ..
    } = row_mode;
    let mut out = x;
    let zero = gamma.like(0.0);
    for k in 0..3 {
        out[k] = T::select(*closed, x[k], zero);
        out[3 + k] = b[0] * x[3 + k] + b[1] * x[6 + k];
        out[6 + k] = T::select(*stick, x[6 + k], zero);
    }
    if alpha.is_some() {
        let one = gamma.like(1.0);
        out[0] += T::select(*closed, zero, one);
        out[4] += *gamma;
        out[8] += T::select(*stick, zero, one);
    }
    out
}

/// Factors of the system, `L` with ones on its diagonal and `U` with the inverse of its own.
pub(super) type BlockFactors<T, const C: usize> = [[ContactBlock<T>; C]; C];

/// `x − L U`.
#[inline(always)]
fn minus_product<T: Lane>(x: &mut ContactBlock<T>, l: &ContactBlock<T>, u: &ContactBlock<T>) {
    for r in 0..3 {
        let row = [l[3 * r], l[3 * r + 1], l[3 * r + 2]];
        for c in 0..3 {
            let mut sum = x[3 * r + c];
            sum -= row[0] * u[c];
            sum -= row[1] * u[3 + c];
            sum -= row[2] * u[6 + c];
            x[3 * r + c] = sum;
        }
    }
}

/// Factors a diagonal block; the diagonal of `U` is inverted.
#[inline(always)]
fn factor_diagonal<T: Lane>(x: &ContactBlock<T>) -> ContactBlock<T> {
    let one = x[0].like(1.0);
    let [x00, x01, x02, x10, x11, x12, x20, x21, x22] = *x;
    let d0 = one / x00;
    let (l1, l2) = (x10 * d0, x20 * d0);
    let (u11, u12) = (x11 - l1 * x01, x12 - l1 * x02);
    let d1 = one / u11;
    let l21 = (x21 - l2 * x01) * d1;
    let d2 = one / (x22 - l2 * x02 - l21 * u12);
    [d0, x01, x02, l1, d1, u12, l2, l21, d2]
}

/// `X U⁻¹` for a factored diagonal block.
#[inline(always)]
fn over_upper<T: Lane>(x: &ContactBlock<T>, f: &ContactBlock<T>) -> ContactBlock<T> {
    let mut out = *x;
    for r in 0..3 {
        let l0 = x[3 * r] * f[0];
        let l1 = (x[3 * r + 1] - l0 * f[1]) * f[4];
        let l2 = (x[3 * r + 2] - l0 * f[2] - l1 * f[5]) * f[8];
        out[3 * r] = l0;
        out[3 * r + 1] = l1;
        out[3 * r + 2] = l2;
    }
    out
}

/// `L⁻¹ X` for a factored diagonal block.
#[inline(always)]
fn under_lower<T: Lane>(x: &ContactBlock<T>, f: &ContactBlock<T>) -> ContactBlock<T> {
    let mut out = *x;
    for c in 0..3 {
        let y1 = x[3 + c] - f[3] * x[c];
        out[3 + c] = y1;
        out[6 + c] = x[6 + c] - f[6] * x[c] - f[7] * y1;
    }
    out
}

/// Factors the system of the modes at the first n places.
#[inline(always)]
pub(super) fn factorise<T: Lane, const C: usize, const B: usize>(
    W: &[ContactBlock<T>; B],
    n: usize,
    alpha: T,
    modes: &[Mode<T>; C],
    factors: &mut BlockFactors<T, C>,
) {
    for k in 0..n {
        let mut diagonal = assemble(W[block(k, k)], Some(alpha), &modes[k], &modes[k]);
        for m in 0..k {
            let (l, u) = (factors[k][m], factors[m][k]);
            minus_product(&mut diagonal, &l, &u);
        }
        let pivot = factor_diagonal(&diagonal);
        factors[k][k] = pivot;
        for i in k + 1..n {
            let mut x = assemble(block_of(W, i, k), None, &modes[i], &modes[k]);
            for m in 0..k {
                let (l, u) = (factors[i][m], factors[m][k]);
                minus_product(&mut x, &l, &u);
            }
            factors[i][k] = over_upper(&x, &pivot);
            let mut x = assemble(block_of(W, k, i), None, &modes[k], &modes[i]);
            for m in 0..k {
                let (l, u) = (factors[k][m], factors[m][i]);
                minus_product(&mut x, &l, &u);
            }
            factors[k][i] = under_lower(&x, &pivot);
        }
    }
}

/// `y ← L⁻¹ y` at the first n places.
#[inline(always)]
pub(super) fn forward<T: Lane, const C: usize>(
    factors: &BlockFactors<T, C>,
    n: usize,
    y: &mut [Triple<T>; C],
) {
    for k in 0..n {
        let mut own = y[k];
        for m in 0..k {
            subtract(&mut own, &factors[k][m], &y[m]);
        }
        let pivot = &factors[k][k];
        own[1] -= pivot[3] * own[0];
        own[2] = own[2] - pivot[6] * own[0] - pivot[7] * own[1];
        y[k] = own;
    }
}

/// `y ← U⁻¹ y` at the first n places.
#[inline(always)]
pub(super) fn backward<T: Lane, const C: usize>(
    factors: &BlockFactors<T, C>,
    n: usize,
    y: &mut [Triple<T>; C],
) {
    for k in (0..n).rev() {
        let mut own = y[k];
        for m in k + 1..n {
            subtract(&mut own, &factors[k][m], &y[m]);
        }
        let f = &factors[k][k];
        own[2] *= f[8];
        own[1] = (own[1] - f[5] * own[2]) * f[4];
        own[0] = (own[0] - f[1] * own[1] - f[2] * own[2]) * f[0];
        y[k] = own;
    }
}

/// `y ← U⁻ᵀ y`, of a row to the left of U.
#[inline(always)]
pub(super) fn backward_row<T: Lane, const C: usize>(
    factors: &BlockFactors<T, C>,
    y: &mut [Triple<T>; C],
) {
    for k in 0..C {
        let mut own = y[k];
        for m in 0..k {
            let (u, known) = (&factors[m][k], y[m]);
            for c in 0..3 {
                own[c] -= known[0] * u[c];
                own[c] -= known[1] * u[3 + c];
                own[c] -= known[2] * u[6 + c];
            }
        }
        let f = &factors[k][k];
        own[0] *= f[0];
        own[1] = (own[1] - own[0] * f[1]) * f[4];
        own[2] = (own[2] - own[0] * f[2] - own[1] * f[5]) * f[8];
        y[k] = own;
    }
}

/// `own −= x y`.
#[inline(always)]
fn subtract<T: Lane>(own: &mut Triple<T>, x: &ContactBlock<T>, y: &Triple<T>) {
    for r in 0..3 {
        own[r] -= x[3 * r] * y[0];
        own[r] -= x[3 * r + 1] * y[1];
        own[r] -= x[3 * r + 2] * y[2];
    }
}

/// Operators with all their blocks; a contact's place is its number. `B`: blocks of the lower
/// triangle of `W`.
///
/// Up to [`MAX_DENSE`] contacts come with `W`, and every place is used. More are those of machines
/// with thin rigid wheels that push or tow each other: their contacts are more than the velocities
/// can tell apart, and the law decides by slips of 1e-12 m/s, which systems in the velocities
/// ([`super::velocities`]) do not resolve. They come with factors of `W`.
#[derive(Clone, Debug)]
pub(super) struct DenseSystem<T: Lane, const C: usize, const B: usize> {
    W: Box<[ContactBlock<T>; B]>,
    pub(super) q: [Triple<T>; C],
    factors: Box<BlockFactors<T, C>>,
    /// Number of each lane's contacts, and the places in use.
    counts: [usize; MAX_LANES],
    n: usize,
}

/// Many of something, made without a copy on the stack.
fn boxed<X: Clone, const N: usize>(x: X) -> Box<[X; N]> {
    let Ok(all) = vec![x; N].into_boxed_slice().try_into() else {
        unreachable!("invariant: it has this length")
    };
    all
}

impl<T: Lane, const C: usize, const B: usize> DenseSystem<T, C, B> {
    /// Whether every place is used, whatever the problems.
    const IS_WHOLE: bool = C <= MAX_DENSE;

    /// Number of places.
    #[inline(always)]
    fn n(&self) -> usize {
        if Self::IS_WHOLE { C } else { self.n }
    }
}

impl<T: Lane, const C: usize, const B: usize> System<T, Few<C>> for DenseSystem<T, C, B> {
    type Places = std::ops::Range<usize>;

    #[inline(always)]
    fn places(&self) -> Self::Places {
        0..self.n()
    }

    #[inline(always)]
    fn free_velocity(&self, place: usize) -> Triple<T> {
        self.q[place]
    }

    #[inline(always)]
    fn velocities(&mut self, p: &[Triple<T>; C], u: &mut [Triple<T>; C]) {
        velocities(&self.W, self.n(), &self.q, p, u);
    }

    #[inline(always)]
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; C]) -> bool {
        factorise(&self.W, self.n(), alpha, modes, &mut self.factors);
        true
    }

    #[inline(always)]
    fn solve(&mut self, modes: &[Mode<T>; C], r: &mut [Triple<T>; C]) {
        let n = self.n();
        for k in 0..n {
            r[k] = modes[k].across(r[k]);
        }
        forward(&self.factors, n, r);
        backward(&self.factors, n, r);
        for k in 0..n {
            r[k] = modes[k].impulse(r[k]);
        }
    }

    #[inline(always)]
    fn solve_one(
        &self,
        place: usize,
        lane: usize,
        free: &Triple<f64>,
        mu: f64,
    ) -> (ContactMode, Triple<f64>) {
        solve_one(&self.W[block(place, place)], lane, free, mu)
    }
}

impl<T: Lane, const C: usize, const B: usize> Loaded<T, C> for DenseSystem<T, C, B> {
    const MAX_STEPS: usize = 80;

    #[inline(always)]
    fn new(token: T::Token) -> Self {
        const { assert!(B == block(C, 0)) };
        let zero = T::splat(token, 0.0);
        Self {
            W: boxed([zero; 9]),
            q: [[zero; 3]; C],
            factors: boxed([[zero; 9]; C]),
            counts: [0; MAX_LANES],
            n: 0,
        }
    }

    #[inline(always)]
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Self::Places {
        let n = problem.n_contacts;
        if Self::IS_WHOLE {
            for (b, (own, w)) in self.W.iter_mut().zip(&problem.W).enumerate() {
                let is_used = b < block(n, 0);
                for k in 0..9 {
                    own[k].set(lane, if is_used { w[k] } else { 0.0 });
                }
            }
            return 0..C;
        }
        let before = std::mem::replace(&mut self.counts[lane], n);
        self.n = self.counts.iter().fold(0, |most, own| most.max(*own));
        for i in 0..n.max(before) {
            for j in 0..=i {
                let w = if i < n {
                    problem.factored.block(i, j)
                } else {
                    [0.0; 9]
                };
                let own = &mut self.W[block(i, j)];
                for k in 0..9 {
                    own[k].set(lane, w[k]);
                }
            }
        }
        0..n.max(before)
    }

    #[inline(always)]
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize> {
        (place < problem.n_contacts).then_some(place)
    }

    #[inline(always)]
    fn least_pivot(&self, lane: usize) -> f64 {
        if !Self::IS_WHOLE {
            return 0.0;
        }
        let mut most = 0.0_f64;
        for k in 0..C {
            let inverse = &self.factors[k][k];
            for own in [0, 4, 8] {
                most = most.max(inverse[own].get(lane).abs());
            }
        }
        1.0 / most
    }

    #[inline(always)]
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9] {
        if Self::IS_WHOLE {
            &problem.W[block(contact, contact)]
        } else {
            &problem.factored.diagonal[contact]
        }
    }

    #[inline(always)]
    fn free_velocity_mut(&mut self, place: usize) -> &mut Triple<T> {
        &mut self.q[place]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Single;
    use crate::solver::batch::pattern::Pattern;
    use crate::solver::batch::problem::{DENSE_BLOCKS, LARGE_BLOCKS, MAX_CONTACTS, MAX_LARGE};
    use crate::solver::batch::velocities::tests::problem;
    use std::sync::Arc;

    #[test]
    fn the_operator_of_the_factors_is_that_of_the_problem() {
        let mut numbers = (1..).map(|k: u32| (f64::from(k) * 0.618).fract() - 0.5);
        let pattern = Arc::new(Pattern::whole(12, MAX_CONTACTS));
        let problem = problem(&pattern, &mut numbers);
        let token = Single::best();
        let mut dense = DenseSystem::<f64, MAX_DENSE, DENSE_BLOCKS>::new(token);
        let mut large = DenseSystem::<f64, MAX_LARGE, LARGE_BLOCKS>::new(token);
        dense.load(0, &problem);
        assert_eq!(large.load(0, &problem), 0..MAX_DENSE);
        let mut p = [[0.0; 3]; MAX_LARGE];
        for x in p.iter_mut().take(MAX_DENSE).flatten() {
            *x = numbers.next().unwrap();
        }
        let (few, _) = p.split_first_chunk().unwrap();
        let mut u = ([[0.0; 3]; MAX_DENSE], [[0.0; 3]; MAX_LARGE]);
        dense.velocities(few, &mut u.0);
        large.velocities(&p, &mut u.1);
        for (a, b) in u.0.iter().flatten().zip(u.1.iter().flatten()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}
