//! How well an impulse solves a problem: the natural map, relative and in m/s.
//!
//! `F_i(p) = p_i − Π_K(p_i − ρ_i ũ_i)` vanishes exactly at the solutions. `ρ_i = d / tr W_ii` (kg), the inverse mean
//! diagonal of the contact's own block, does not depend on the choice of tangents. Two numbers are made of it:
//!
//! - `relative = |F| / |(ρ_i q_i)|`: error against the impulses that the free velocity asks for;
//! - `velocity = max_i |F_i| / ρ_i` in m/s, which a large mass ratio cannot hide.

use super::{Dimension, FrictionContactProblem};
use crate::law::coulomb::natural_map;

/// Distance of an impulse from the law, see the page above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Natural map relative to the data, dimensionless; the plain norm in N s when `q = 0`.
    pub relative: f64,
    /// Largest violation at one contact, m/s.
    pub velocity: f64,
}

impl Residual {
    /// Both numbers infinite: nothing is known to be solved.
    pub const UNSOLVED: Self = Self {
        relative: f64::INFINITY,
        velocity: f64::INFINITY,
    };

    /// Whether both numbers are finite.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.relative.is_finite() && self.velocity.is_finite()
    }
}

/// Rows of a product that are computed together.
const ROWS: usize = 3;

/// Scalar product with four partial sums, so that it runs in vector registers.
#[inline]
#[must_use]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let mut sums = [0.0; 4];
    let (mut chunks_a, mut chunks_b) = (a.chunks_exact(4), b.chunks_exact(4));
    for (x, y) in chunks_a.by_ref().zip(chunks_b.by_ref()) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let mut tail = 0.0;
    for (x, y) in chunks_a.remainder().iter().zip(chunks_b.remainder()) {
        tail += x * y;
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
}

/// `out = A x + b` for a row-major square matrix `A`; of up to six contacts the size is known to the compiler.
#[inline]
pub(crate) fn multiply_add(A: &[f64], x: &[f64], b: &[f64], out: &mut [f64]) {
    match x.len() {
        0 => {}
        3 => multiply_add_of(3, A, x, b, out),
        6 => multiply_add_of(6, A, x, b, out),
        9 => multiply_add_of(9, A, x, b, out),
        12 => multiply_add_of(12, A, x, b, out),
        15 => multiply_add_of(15, A, x, b, out),
        18 => multiply_add_of(18, A, x, b, out),
        n => multiply_add_of(n, A, x, b, out),
    }
}

/// Three rows at a time, so that `x` is loaded once for them.
#[allow(clippy::inline_always)] // the known size has to reach the loops
#[inline(always)]
fn multiply_add_of(n: usize, A: &[f64], x: &[f64], b: &[f64], out: &mut [f64]) {
    let (x, b, out) = (&x[..n], &b[..n], &mut out[..n]);
    let (pairs, last) = x.as_chunks::<2>();
    let results = out.chunks_exact_mut(ROWS).zip(b.chunks_exact(ROWS));
    for (group, (out, b)) in A.chunks_exact(ROWS * n).zip(results) {
        let rows: [&[f64]; ROWS] = std::array::from_fn(|r| &group[r * n..(r + 1) * n]);
        let chunks = rows.map(|row| &row.as_chunks::<2>().0[..pairs.len()]);
        let mut sums = [[0.0; 2]; ROWS];
        for (i, x) in pairs.iter().enumerate() {
            for (sum, row) in sums.iter_mut().zip(chunks) {
                sum[0] += row[i][0] * x[0];
                sum[1] += row[i][1] * x[1];
            }
        }
        if let [x] = last {
            for (sum, row) in sums.iter_mut().zip(rows) {
                sum[0] += row[n - 1] * x;
            }
        }
        for r in 0..ROWS {
            out[r] = (sums[r][0] + sums[r][1]) + b[r];
        }
    }
    for r in n - n % ROWS..n {
        out[r] = dot(&A[r * n..(r + 1) * n], x) + b[r];
    }
}

/// Local velocity `u = W p + q` (n), m/s, of the impulses `p` (n), N s.
///
/// # Panics
/// If `p` or `u` has not the problem's number of unknowns.
pub fn local_velocity(problem: &FrictionContactProblem<'_>, p: &[f64], u: &mut [f64]) {
    assert!(
        p.len() == problem.n_unknowns(),
        "p must have one entry per unknown"
    );
    assert!(
        u.len() == problem.n_unknowns(),
        "u must have one entry per unknown"
    );
    problem
        .operator()
        .multiply_add(p, problem.free_velocity(), u);
}

/// The scale `ρ_i = d / tr W_ii` of one contact, kg; 1 where the block has no positive trace.
#[inline]
#[must_use]
pub fn contact_scale(problem: &FrictionContactProblem<'_>, contact: usize) -> f64 {
    let (dimension, n, W) = (
        problem.dimension(),
        problem.n_unknowns(),
        problem.operator(),
    );
    let d = dimension.components();
    let trace: f64 = (0..d).map(|k| W.diagonal(dimension, n, contact, k)).sum();
    if trace > 0.0 { d as f64 / trace } else { 1.0 }
}

/// Natural map of the contact that starts at `offset`: squared norm in (N s)².
#[inline]
pub(crate) fn evaluate_contact<const D: usize>(
    p: &[f64],
    u: &[f64],
    offset: usize,
    mu: f64,
    rho: f64,
) -> f64 {
    let mut p_i = [0.0; D];
    let mut u_i = [0.0; D];
    p_i.copy_from_slice(&p[offset..offset + D]);
    u_i.copy_from_slice(&u[offset..offset + D]);
    natural_map(&p_i, &u_i, mu, rho).iter().map(|x| x * x).sum()
}

fn evaluate_in<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    p: &[f64],
    u: &[f64],
) -> Residual {
    let (mut map, mut data, mut velocity) = (0.0, 0.0, 0.0_f64);
    let mut finite = true;
    for (contact, &mu) in problem.friction_coefficients().iter().enumerate() {
        let rho = contact_scale(problem, contact);
        let offset = D * contact;
        let square = evaluate_contact::<D>(p, u, offset, mu, rho);
        finite &= square.is_finite();
        map += square;
        velocity = velocity.max(square / (rho * rho));
        for q in &problem.free_velocity()[offset..offset + D] {
            data += (rho * q) * (rho * q);
        }
    }
    if !finite {
        return Residual::UNSOLVED;
    }
    let relative = if data > 0.0 {
        (map / data).sqrt()
    } else {
        map.sqrt()
    };
    Residual {
        relative,
        velocity: velocity.sqrt(),
    }
}

/// Residual of `p`, with `u = W p + q` computed on the way.
///
/// `p`: impulses (n), N s. `u`: local velocities (n), m/s, output.
///
/// # Panics
/// If `p` or `u` has not the problem's number of unknowns.
#[must_use]
pub fn evaluate_into(problem: &FrictionContactProblem<'_>, p: &[f64], u: &mut [f64]) -> Residual {
    local_velocity(problem, p, u);
    match problem.dimension() {
        Dimension::Two => evaluate_in::<2>(problem, p, u),
        Dimension::Three => evaluate_in::<3>(problem, p, u),
    }
}

/// Residual of `p` (n), N s; allocates the velocities it needs.
///
/// # Panics
/// If `p` has not the problem's number of unknowns.
#[must_use]
pub fn evaluate(problem: &FrictionContactProblem<'_>, p: &[f64]) -> Residual {
    evaluate_into(problem, p, &mut vec![0.0; problem.n_unknowns()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalar_product_of_every_length() {
        for n in 0..12 {
            let a: Vec<f64> = (0..n).map(|k| f64::from(k) + 1.0).collect();
            let expected: f64 = a.iter().map(|x| x * x).sum();
            assert!((dot(&a, &a) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_resting_block_has_no_residual_and_a_floating_one_its_velocity() {
        let W = [0.5, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5];
        let q = [-0.1, 0.02, 0.0];
        let problem = FrictionContactProblem::new(Dimension::Three, &W, &q, &[0.7]).expect("sound");
        // m = 2 kg sticks: p = −m q.
        let solved = evaluate(&problem, &[0.2, -0.04, 0.0]);
        assert!(solved.relative < 1e-15 && solved.velocity < 1e-15);
        let open = evaluate(&problem, &[0.0; 3]);
        assert!(open.relative > 0.5 && open.velocity > 0.08, "{open:?}");
    }

    #[test]
    fn a_nan_is_unsolved() {
        let W = [f64::NAN, 0.0, 0.0, 1.0];
        let problem = FrictionContactProblem::from_assembled(Dimension::Two, &W, &[0.0; 2], &[0.5]);
        assert!(!evaluate(&problem, &[0.0; 2]).is_finite());
    }
}
