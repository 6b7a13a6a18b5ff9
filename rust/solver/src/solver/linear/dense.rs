//! Factorisations of the dense systems of a Newton step, in place and without allocation.
//!
//! Matrices are column-major. Their size is a multiple of [`LANES`] (the caller pads with the unit
//! matrix), and they are stored in chunks of that many entries. Every loop thus runs over whole
//! chunks, and the trailing matrix is loaded and stored once per [`LANES`] eliminated columns. This
//! is fast for six contacts, which fit in the first-level cache, and for hundreds.
#![allow(clippy::inline_always)] // loop bounds are known only where the size is

/// Entries of a chunk, and columns that are eliminated together.
pub(super) const LANES: usize = 4;

/// Least pivot relative to the entries below it that is accepted without an exchange of rows.
/// `W` with modes is near a positive definite matrix, which needs hardly any: the iterations of an
/// exploring rover are those with the largest pivots.
const THRESHOLD: f64 = 0.01;

/// Entries that the loops process together.
pub(super) type Chunk = [f64; LANES];

/// Size of the padded system of `m` unknowns, in chunks.
#[inline]
pub(super) const fn chunks(m: usize) -> usize {
    m.div_ceil(LANES)
}

/// Calls `body` with `size`, as a constant for a few contacts, so that the bounds of all its loops
/// are known.
macro_rules! with_known_size {
    ($size:expr, |$known:ident| $body:expr) => {{
        match $size {
            1 => {
                let $known = 1;
                $body
            }
            2 => {
                let $known = 2;
                $body
            }
            3 => {
                let $known = 3;
                $body
            }
            4 => {
                let $known = 4;
                $body
            }
            5 => {
                let $known = 5;
                $body
            }
            $known => $body,
        }
    }};
}

/// The first columns of a panel, each of `size` chunks.
#[inline(always)]
fn panel_columns(panel: &[Chunk], size: usize) -> [&[Chunk]; LANES] {
    std::array::from_fn(|k| &panel[k * size..(k + 1) * size])
}

/// `x[c] -= Σ_k factors[k] columns[k][c]` for the chunks `c` of a range.
#[inline(always)]
fn subtract_columns(
    x: &mut [Chunk],
    columns: [&[Chunk]; LANES],
    factors: Chunk,
    range: std::ops::Range<usize>,
) {
    let x = &mut x[range.clone()];
    let [a, b, c, d] = columns.map(|column| &column[range.clone()]);
    for ((((x, a), b), c), d) in x.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        // Read whole before the write, so that the compiler need not prove that the columns do not
        // alias.
        let (a, b, c, d) = (*a, *b, *c, *d);
        let old = *x;
        *x = std::array::from_fn(|l| {
            old[l]
                - ((factors[0] * a[l] + factors[1] * b[l])
                    + (factors[2] * c[l] + factors[3] * d[l]))
        });
    }
}

/// Cholesky factor `A = L Lᵀ` of a symmetric matrix of `size` chunks a
/// side, of which only the lower triangle is read.
///
/// `L` replaces the lower triangle, with reciprocal diagonal. Returns
/// `false` when a pivot is not positive; then `A` is spoilt.
#[must_use]
pub(super) fn cholesky(A: &mut [Chunk], size: usize) -> bool {
    with_known_size!(size, |size| cholesky_of(A, size))
}

#[inline(always)]
fn cholesky_of(A: &mut [Chunk], size: usize) -> bool {
    let A = &mut A[..LANES * size * size];
    for block in 0..size {
        for k in 0..LANES {
            let (own, right) = A[(LANES * block + k) * size..].split_at_mut(size);
            let pivot = own[block][k];
            if pivot.is_nan() || pivot <= 0.0 {
                return false;
            }
            let reciprocal = 1.0 / pivot.sqrt();
            for chunk in &mut own[block..] {
                *chunk = chunk.map(|x| x * reciprocal);
            }
            own[block][k] = reciprocal;
            for (j, other) in right.chunks_exact_mut(size).take(LANES - 1 - k).enumerate() {
                subtract(other, own, own[block][k + 1 + j], block);
            }
        }
        let (left, right) = A.split_at_mut(LANES * (block + 1) * size);
        let panel = panel_columns(&left[LANES * block * size..], size);
        for (j, column) in right.chunks_exact_mut(size).enumerate() {
            let at = block + 1 + j / LANES;
            let factors = panel.map(|own| own[at][j % LANES]);
            subtract_columns(column, panel, factors, at..size);
        }
    }
    true
}

/// `x -= factor other` from chunk `first` on.
#[inline(always)]
fn subtract(x: &mut [Chunk], other: &[Chunk], factor: f64, first: usize) {
    for (x, y) in x[first..].iter_mut().zip(&other[first..]) {
        let (old, y) = (*x, *y);
        *x = std::array::from_fn(|l| old[l] - factor * y[l]);
    }
}

/// Solves `L Lᵀ x = b` in place of `b`, with the factor of [`cholesky`].
pub(super) fn cholesky_solve(L: &[Chunk], size: usize, b: &mut [Chunk]) {
    with_known_size!(size, |size| cholesky_solve_of(L, size, b));
}

#[inline(always)]
fn cholesky_solve_of(L: &[Chunk], size: usize, b: &mut [Chunk]) {
    let L = &L[..LANES * size * size];
    let b = &mut b[..size];
    let columns = |block: usize| panel_columns(&L[LANES * block * size..], size);
    for block in 0..size {
        let panel = columns(block);
        let x = &mut b[block];
        for k in 0..LANES {
            x[k] *= panel[k][block][k];
            for l in k + 1..LANES {
                x[l] -= panel[k][block][l] * x[k];
            }
        }
        let x = *x;
        subtract_columns(b, panel, x, block + 1..size);
    }
    for block in (0..size).rev() {
        let panel = columns(block);
        let (above, below) = b.split_at_mut(block + 1);
        let x = &mut above[block];
        let products = panel.map(|column| {
            let mut sums = [0.0; LANES];
            for (y, z) in column[block + 1..].iter().zip(&*below) {
                for l in 0..LANES {
                    sums[l] += y[l] * z[l];
                }
            }
            (sums[0] + sums[1]) + (sums[2] + sums[3])
        });
        for k in (0..LANES).rev() {
            let mut rest = x[k] - products[k];
            for l in k + 1..LANES {
                rest -= panel[k][block][l] * x[l];
            }
            x[k] = rest * panel[k][block][k];
        }
    }
}

/// LU factors of a matrix of `size` chunks a side, in place; the diagonal of `U` is stored
/// reciprocal. Rows are exchanged where the diagonal is [much smaller](THRESHOLD) than what is
/// below it.
///
/// Returns `false` at a zero or non-finite pivot.
#[must_use]
pub(super) fn lu(A: &mut [Chunk], size: usize, pivots: &mut [usize]) -> bool {
    with_known_size!(size, |size| lu_of(A, size, pivots))
}

#[inline(always)]
fn lu_of(A: &mut [Chunk], size: usize, pivots: &mut [usize]) -> bool {
    let A = &mut A[..LANES * size * size];
    let pivots = &mut pivots[..LANES * size];
    for block in 0..size {
        let is_regular = lu_column::<0>(A, size, block, pivots)
            && lu_column::<1>(A, size, block, pivots)
            && lu_column::<2>(A, size, block, pivots)
            && lu_column::<3>(A, size, block, pivots);
        if !is_regular {
            return false;
        }
        let (left, right) = A.split_at_mut(LANES * (block + 1) * size);
        let panel = panel_columns(&left[LANES * block * size..], size);
        for column in right.chunks_exact_mut(size) {
            let factors = eliminate(&mut column[block], panel, block);
            subtract_columns(column, panel, factors, block + 1..size);
        }
    }
    true
}

/// Eliminates column `K` of a panel from those right of it in the panel; a
/// constant, so that what is left of a chunk has a known length.
#[inline(always)]
fn lu_column<const K: usize>(
    A: &mut [Chunk],
    size: usize,
    block: usize,
    pivots: &mut [usize],
) -> bool {
    let column = LANES * block + K;
    if !exchange(A, size, (block, K), pivots) {
        return false;
    }
    let (own, right) = A[column * size..].split_at_mut(size);
    let reciprocal = 1.0 / own[block][K];
    for l in K + 1..LANES {
        own[block][l] *= reciprocal;
    }
    for chunk in &mut own[block + 1..] {
        *chunk = chunk.map(|x| x * reciprocal);
    }
    own[block][K] = reciprocal;
    for other in right.chunks_exact_mut(size).take(LANES - 1 - K) {
        let factor = other[block][K];
        for l in K + 1..LANES {
            other[block][l] -= factor * own[block][l];
        }
        subtract(other, own, factor, block + 1);
    }
    true
}

/// Solves with the unit lower triangle of a diagonal block, in place.
#[inline(always)]
fn eliminate(x: &mut Chunk, panel: [&[Chunk]; LANES], block: usize) -> Chunk {
    for k in 0..LANES - 1 {
        for l in k + 1..LANES {
            x[l] -= panel[k][block][l] * x[k];
        }
    }
    *x
}

/// Puts an acceptable pivot onto the diagonal of a column; `false` if all below it is zero or not
/// finite. The column is named by its diagonal's chunk and the place there.
#[inline(always)]
fn exchange(
    A: &mut [Chunk],
    size: usize,
    (block, lane): (usize, usize),
    pivots: &mut [usize],
) -> bool {
    let k = LANES * block + lane;
    let column = &A[k * size..(k + 1) * size];
    let mut below = [0.0; LANES];
    for l in lane + 1..LANES {
        below[l] = column[block][l].abs();
    }
    for chunk in &column[block + 1..] {
        below = std::array::from_fn(|l| larger(chunk[l].abs(), below[l]));
    }
    let largest = larger(larger(below[0], below[1]), larger(below[2], below[3]));
    let own = column[block][lane].abs();
    if own >= THRESHOLD * largest && own > 0.0 {
        pivots[k] = k;
        return own.is_finite();
    }
    exchange_largest(A, size, k, pivots);
    largest > 0.0 && largest.is_finite()
}

/// The larger of two numbers that are not NaN, in one instruction.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Brings the largest entry of column `k` at or below the diagonal onto it.
#[cold]
fn exchange_largest(A: &mut [Chunk], size: usize, k: usize, pivots: &mut [usize]) {
    let column = A[k * size..(k + 1) * size].as_flattened();
    let mut best = k;
    for (row, x) in column.iter().enumerate().skip(k + 1) {
        if x.abs() > column[best].abs() {
            best = row;
        }
    }
    pivots[k] = best;
    for column in A.chunks_exact_mut(size) {
        column.as_flattened_mut().swap(k, best);
    }
}

/// Solves `A x = b` in place of `b`, with the factors of [`lu`].
pub(super) fn lu_solve(A: &[Chunk], size: usize, pivots: &[usize], b: &mut [Chunk]) {
    with_known_size!(size, |size| lu_solve_of(A, size, pivots, b));
}

#[inline(always)]
fn lu_solve_of(A: &[Chunk], size: usize, pivots: &[usize], b: &mut [Chunk]) {
    let A = &A[..LANES * size * size];
    let b = &mut b[..size];
    let columns = |block: usize| panel_columns(&A[LANES * block * size..], size);
    let flat = b.as_flattened_mut();
    for (k, &pivot) in pivots.iter().take(LANES * size).enumerate() {
        flat.swap(k, pivot);
    }
    for block in 0..size {
        let panel = columns(block);
        let x = eliminate(&mut b[block], panel, block);
        subtract_columns(b, panel, x, block + 1..size);
    }
    for block in (0..size).rev() {
        let panel = columns(block);
        let x = &mut b[block];
        for k in (0..LANES).rev() {
            x[k] *= panel[k][block][k];
            for l in 0..k {
                x[l] -= panel[k][block][l] * x[k];
            }
        }
        let x = *x;
        subtract_columns(b, panel, x, 0..block);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Padded with the unit matrix; `entry(i, j)` is row `i`, column `j`.
    fn padded(m: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<Chunk> {
        let size = chunks(m);
        let mut A = vec![[0.0; LANES]; LANES * size * size];
        for j in 0..LANES * size {
            for i in 0..LANES * size {
                A[j * size + i / LANES][i % LANES] = if i < m && j < m {
                    entry(i, j)
                } else {
                    f64::from(u8::from(i == j))
                };
            }
        }
        A
    }

    fn vector(m: usize, entry: impl Fn(usize) -> f64) -> Vec<Chunk> {
        let mut x = vec![[0.0; LANES]; chunks(m)];
        for i in 0..m {
            x[i / LANES][i % LANES] = entry(i);
        }
        x
    }

    #[test]
    fn singular_matrices_are_refused() {
        let zero = |_, _| 0.0;
        assert!(!lu(&mut padded(3, zero), 1, &mut [0; 4]));
        let indefinite = |i: usize, j: usize| if i == j { 1.0 - 2.0 * i as f64 } else { 0.0 };
        assert!(!cholesky(&mut padded(2, indefinite), 1));
        assert!(!cholesky(&mut padded(1, |_, _| f64::NAN), 1));
    }

    proptest! {
        #[test]
        fn factors_solve(entries in prop::collection::vec(-1.0..1.0f64, 400), m in 1usize..20) {
            let size = chunks(m);
            // Off the diagonal, so that rows have to be exchanged.
            let general = |i: usize, j: usize| {
                let large = if j == (i + 1) % m { 3.0 * (m as f64).sqrt() } else { 0.0 };
                entries[i * m + j] + large
            };
            // AᵀA is symmetric positive definite.
            let gram = |i: usize, j: usize| (0..m).map(|k| general(k, i) * general(k, j)).sum::<f64>();
            let mut factors = padded(m, general);
            let mut pivots = vec![0; LANES * size];
            let mut b = vector(m, |i| (0..m).map(|j| general(i, j) * entries[j]).sum());
            prop_assert!(lu(&mut factors, size, &mut pivots));
            lu_solve(&factors, size, &pivots, &mut b);
            for k in 0..m {
                prop_assert!((b[k / LANES][k % LANES] - entries[k]).abs() < 1e-11);
            }
            let mut factors = padded(m, gram);
            let mut b = vector(m, |i| (0..m).map(|j| gram(i, j) * entries[j]).sum());
            prop_assert!(cholesky(&mut factors, size));
            cholesky_solve(&factors, size, &mut b);
            for k in 0..m {
                prop_assert!((b[k / LANES][k % LANES] - entries[k]).abs() < 1e-9);
            }
        }
    }
}
