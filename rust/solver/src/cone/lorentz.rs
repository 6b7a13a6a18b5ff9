//! Lorentz's cone `{ x_0 ≥ |x_T| }` and its algebra: Coulomb's cone in the units `(μ p_N, p_T)`.

/// `x ∘ z` of Lorentz's cone.
pub(crate) fn jordan<const D: usize>(x: &[f64; D], z: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|k| match k {
        0 => dot(x, z),
        _ => x[0] * z[k] + z[0] * x[k],
    })
}

/// `xᵀ z`.
pub(crate) fn dot<const D: usize>(x: &[f64; D], z: &[f64; D]) -> f64 {
    x.iter().zip(z).map(|(x, z)| x * z).sum()
}

/// Length of the tangential part.
pub(crate) fn tangential<const D: usize>(x: &[f64; D]) -> f64 {
    x[1..].iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// `x_0² − |x_T|²`.
pub(crate) fn determinant<const D: usize>(x: &[f64; D]) -> f64 {
    let t = tangential(x);
    (x[0] - t) * (x[0] + t)
}

/// The step along `d` at which `x` meets the boundary of the cone.
pub(crate) fn way_out<const D: usize>(x: &[f64; D], d: &[f64; D]) -> f64 {
    let a = d[0] * d[0] - d[1..].iter().map(|d| d * d).sum::<f64>();
    let b = x[0] * d[0] - x[1..].iter().zip(&d[1..]).map(|(x, d)| x * d).sum::<f64>();
    let c = determinant(x);
    let mut way = if d[0] < 0.0 {
        -x[0] / d[0]
    } else {
        f64::INFINITY
    };
    let square = b * b - a * c;
    if square >= 0.0 {
        let root = square.sqrt();
        for candidate in [c / (root - b), -c / (root + b)] {
            if candidate > 0.0 && candidate < way {
                way = candidate;
            }
        }
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_out_ends_on_the_boundary() {
        let (x, d) = ([2.0, 0.5, -0.3], [-0.4, 0.8, 0.1]);
        let t = way_out(&x, &d);
        let end: [f64; 3] = std::array::from_fn(|k| x[k] + t * d[k]);
        assert!(determinant(&end).abs() < 1e-14 && end[0] > 0.0);
        assert!(way_out(&x, &[1.0, 0.5, 0.0]).is_infinite());
        // x ∘ x = 2 x_0 x − det(x) e.
        let square = jordan(&x, &x);
        let expected = [
            2.0 * x[0] * x[0] - determinant(&x),
            2.0 * x[0] * x[1],
            2.0 * x[0] * x[2],
        ];
        assert!((0..3).all(|k| (square[k] - expected[k]).abs() < 1e-14));
    }
}
