//! Factorisations of the small dense systems of a Newton step, in place and without allocation.

/// Cholesky factor `A = L Lᵀ` of a symmetric matrix, row-major `m × m`, of which only the lower triangle is read.
///
/// `L` replaces the lower triangle, with reciprocal diagonal. Returns `false` when a pivot is not positive; then `A` is spoilt.
#[must_use]
pub(super) fn cholesky(A: &mut [f64], m: usize) -> bool {
    // Row by row (Cholesky–Banachiewicz): every inner product runs along two contiguous rows.
    for i in 0..m {
        let (above, rest) = A.split_at_mut(i * m);
        let row = &mut rest[..m];
        for (j, row_j) in above.chunks_exact(m).enumerate() {
            let sum = row[j] - crate::problem::dot(&row[..j], &row_j[..j]);
            row[j] = sum * row_j[j];
        }
        let pivot = row[i] - crate::problem::dot(&row[..i], &row[..i]);
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        row[i] = 1.0 / pivot.sqrt();
    }
    true
}

/// Solves `L Lᵀ x = b` in place of `b`, with the factor of [`cholesky`].
pub(super) fn cholesky_solve(L: &[f64], m: usize, b: &mut [f64]) {
    if m == 0 {
        return;
    }
    for (i, row) in L.chunks_exact(m).enumerate() {
        b[i] = (b[i] - crate::problem::dot(&row[..i], &b[..i])) * row[i];
    }
    for (i, row) in L.chunks_exact(m).enumerate().rev() {
        let x = b[i] * row[i];
        b[i] = x;
        for (value, l) in b[..i].iter_mut().zip(&row[..i]) {
            *value -= l * x;
        }
    }
}

/// LU factors with row exchanges of a row-major `m × m` matrix, in place; the diagonal of `U` is stored reciprocal.
///
/// Returns `false` at a zero or non-finite pivot.
#[must_use]
pub(super) fn lu(A: &mut [f64], m: usize, pivots: &mut [usize]) -> bool {
    for k in 0..m {
        let mut best = k;
        let mut size = A[k * m + k].abs();
        for i in k + 1..m {
            let candidate = A[i * m + k].abs();
            if candidate > size {
                size = candidate;
                best = i;
            }
        }
        if !(size > 0.0 && size.is_finite()) {
            return false;
        }
        pivots[k] = best;
        if best != k {
            let (upper, lower) = A.split_at_mut(best * m);
            upper[k * m..(k + 1) * m].swap_with_slice(&mut lower[..m]);
        }
        let (upper, lower) = A.split_at_mut((k + 1) * m);
        let pivot_row = &mut upper[k * m..];
        let reciprocal = 1.0 / pivot_row[k];
        pivot_row[k] = reciprocal;
        let tail = &pivot_row[k + 1..m];
        for row in lower.chunks_exact_mut(m) {
            let factor = row[k] * reciprocal;
            row[k] = factor;
            for (value, u) in row[k + 1..].iter_mut().zip(tail) {
                *value -= factor * u;
            }
        }
    }
    true
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
        b[i] -= crate::problem::dot(&row[..i], &b[..i]);
    }
    for (i, row) in A.chunks_exact(m).enumerate().rev() {
        b[i] = (b[i] - crate::problem::dot(&row[i + 1..], &b[i + 1..m])) * row[i];
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
                general[k * (m + 1)] += 3.0 * (m as f64).sqrt();
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
                prop_assert!((b[k] - x[k]).abs() < 1e-10);
            }
        }
    }
}
