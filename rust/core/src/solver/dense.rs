//! Factorisations of the dense systems of a Newton step, in place and without allocation.
//!
//! Both go by panels of [`PANEL`] rows: what is left of the matrix is loaded and stored once per panel, which serves six contacts
//! (everything in registers and the first cache) as well as hundreds.

use crate::problem::dot;

/// Rows that are eliminated together.
const PANEL: usize = 4;

/// `row -= Σ_k factors[k] panel[k]`, on equal ranges.
#[inline]
fn subtract_panel(row: &mut [f64], factors: [f64; PANEL], panel: [&[f64]; PANEL]) {
    let n = row.len();
    let [a, b, c, d] = panel.map(|x| &x[..n]);
    for ((((x, a), b), c), d) in row.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *x -= (factors[0] * a + factors[1] * b) + (factors[2] * c + factors[3] * d);
    }
}

/// `row -= factor other`, on equal ranges.
#[inline]
fn subtract(row: &mut [f64], factor: f64, other: &[f64]) {
    for (x, y) in row.iter_mut().zip(other) {
        *x -= factor * y;
    }
}

/// The four rows of a panel that begins at row `first`, each from column `from`.
#[inline]
fn panel_rows(above: &[f64], m: usize, first: usize, from: usize) -> [&[f64]; PANEL] {
    std::array::from_fn(|k| &above[(first + k) * m + from..(first + k + 1) * m])
}

/// Cholesky factor `A = Uᵀ U` of a symmetric matrix, row-major `m × m`, of which only the upper triangle is read.
///
/// `U` replaces the upper triangle, with reciprocal diagonal. Returns `false` when a pivot is not positive; then `A` is spoilt.
#[must_use]
pub(super) fn cholesky(A: &mut [f64], m: usize) -> bool {
    for first in (0..m).step_by(PANEL) {
        let last = (first + PANEL).min(m);
        for k in first..last {
            let (above, rest) = A.split_at_mut(k * m);
            let row = &mut rest[k..m];
            for j in first..k {
                let other = &above[j * m + k..(j + 1) * m];
                subtract(row, other[0], other);
            }
            let pivot = row[0];
            if pivot.is_nan() || pivot <= 0.0 {
                return false;
            }
            let reciprocal = 1.0 / pivot.sqrt();
            for x in &mut *row {
                *x *= reciprocal;
            }
            row[0] = reciprocal;
        }
        if last < first + PANEL {
            break;
        }
        let (above, rest) = A.split_at_mut(last * m);
        for (i, row) in rest.chunks_exact_mut(m).enumerate() {
            let panel = panel_rows(above, m, first, last + i);
            subtract_panel(&mut row[last + i..], panel.map(|u| u[0]), panel);
        }
    }
    true
}

/// Solves `Uᵀ U x = b` in place of `b`, with the factor of [`cholesky`].
pub(super) fn cholesky_solve(U: &[f64], m: usize, b: &mut [f64]) {
    if m == 0 {
        return;
    }
    for (i, row) in U.chunks_exact(m).enumerate() {
        let x = b[i] * row[i];
        b[i] = x;
        subtract(&mut b[i + 1..m], x, &row[i + 1..]);
    }
    for (i, row) in U.chunks_exact(m).enumerate().rev() {
        b[i] = (b[i] - dot(&row[i + 1..], &b[i + 1..m])) * row[i];
    }
}

/// LU factors with row exchanges of a row-major `m × m` matrix, in place; the diagonal of `U` is stored reciprocal.
///
/// Returns `false` at a zero or non-finite pivot.
#[must_use]
pub(super) fn lu(A: &mut [f64], m: usize, pivots: &mut [usize]) -> bool {
    for first in (0..m).step_by(PANEL) {
        let last = (first + PANEL).min(m);
        for k in first..last {
            if !exchange(A, m, k, pivots) {
                return false;
            }
            let (above, below) = A.split_at_mut((k + 1) * m);
            let pivot_row = &mut above[k * m..];
            let reciprocal = 1.0 / pivot_row[k];
            pivot_row[k] = reciprocal;
            let tail = &pivot_row[k + 1..last];
            for row in below.chunks_exact_mut(m) {
                let factor = row[k] * reciprocal;
                row[k] = factor;
                subtract(&mut row[k + 1..last], factor, tail);
            }
        }
        if last == m {
            break;
        }
        for k in first + 1..last {
            let (above, rest) = A.split_at_mut(k * m);
            let (factors, row) = rest[..m].split_at_mut(last);
            for j in first..k {
                subtract(row, factors[j], &above[j * m + last..(j + 1) * m]);
            }
        }
        let (above, below) = A.split_at_mut(last * m);
        let panel = panel_rows(above, m, first, last);
        for row in below.chunks_exact_mut(m) {
            let (factors, row) = row.split_at_mut(last);
            subtract_panel(row, std::array::from_fn(|k| factors[first + k]), panel);
        }
    }
    true
}

/// Brings the largest entry of column `k` at or below the diagonal onto it; `false` if it is zero or not finite.
#[inline]
fn exchange(A: &mut [f64], m: usize, k: usize, pivots: &mut [usize]) -> bool {
    let mut best = k;
    let mut size = A[k * m + k].abs();
    for (i, row) in A.chunks_exact(m).enumerate().skip(k + 1) {
        let candidate = row[k].abs();
        if candidate > size {
            size = candidate;
            best = i;
        }
    }
    pivots[k] = best;
    if best != k {
        let (above, below) = A.split_at_mut(best * m);
        above[k * m..(k + 1) * m].swap_with_slice(&mut below[..m]);
    }
    size > 0.0 && size.is_finite()
}

/// Solves `A x = b` in place of `b`, with the factors of [`lu`].
pub(super) fn lu_solve(A: &[f64], m: usize, pivots: &[usize], b: &mut [f64]) {
    if m == 0 {
        return;
    }
    for k in 0..m {
        b.swap(k, pivots[k]);
    }
    for (i, row) in A.chunks_exact(m).enumerate() {
        b[i] -= dot(&row[..i], &b[..i]);
    }
    for (i, row) in A.chunks_exact(m).enumerate().rev() {
        b[i] = (b[i] - dot(&row[i + 1..], &b[i + 1..m])) * row[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn product(A: &[f64], x: &[f64]) -> Vec<f64> {
        A.chunks_exact(x.len())
            .map(|row| crate::problem::dot(row, x))
            .collect()
    }

    #[test]
    fn singular_matrices_are_refused() {
        assert!(!lu(&mut [0.0; 9], 3, &mut [0; 3]));
        assert!(!cholesky(&mut [1.0, 0.0, 0.0, -1.0], 2));
        assert!(!cholesky(&mut [f64::NAN], 1));
    }

    proptest! {
        #[test]
        fn factors_solve(entries in prop::collection::vec(-1.0..1.0f64, 400), m in 1usize..20) {
            let x: Vec<f64> = entries[..m].to_vec();
            let mut general = entries[..m * m].to_vec();
            for k in 0..m {
                // Off the diagonal, so that rows have to be exchanged.
                general[k * m + (k + 1) % m] += 3.0 * (m as f64).sqrt();
            }
            let mut b = product(&general, &x);
            let mut pivots = vec![0; m];
            let mut factors = general.clone();
            prop_assert!(lu(&mut factors, m, &mut pivots));
            lu_solve(&factors, m, &pivots, &mut b);
            for k in 0..m {
                prop_assert!((b[k] - x[k]).abs() < 1e-11);
            }
            // AᵀA is symmetric positive definite.
            let mut gram = vec![0.0; m * m];
            for i in 0..m {
                for j in 0..m {
                    gram[i * m + j] = (0..m).map(|k| general[k * m + i] * general[k * m + j]).sum();
                }
            }
            let mut b = product(&gram, &x);
            prop_assert!(cholesky(&mut gram, m));
            cholesky_solve(&gram, m, &mut b);
            for k in 0..m {
                prop_assert!((b[k] - x[k]).abs() < 1e-9);
            }
        }
    }
}
