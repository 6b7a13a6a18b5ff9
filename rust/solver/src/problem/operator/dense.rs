//! Products with a dense row-major matrix, written so that they run in vector registers.

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

/// `out = A x + b` for a row-major square matrix `A`; for up to six contacts the compiler knows the
/// size.
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
}
