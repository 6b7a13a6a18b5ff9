//! Formulas that hold in the plane (D = 2) and in space (D = 3) alike.
//!
//! A body has D velocities of its centre and D (D − 1)/2 rates of turning:
//! one in the plane, three in space.

use nalgebra::SVector;

use crate::scalar::elementary::hypot;

/// Velocities of a body in D dimensions: 3 in the plane, 6 in space.
#[must_use]
pub const fn body_velocities(dimensions: usize) -> usize {
    dimensions * (dimensions + 1) / 2
}

/// Unit vector along axis k: x, y, z from 0.
#[inline]
#[must_use]
pub fn axis<const D: usize>(k: usize) -> SVector<f64, D> {
    SVector::from_fn(|i, _| if i == k { 1.0 } else { 0.0 })
}

/// Length of a vector of at least one entry, without overflow.
#[inline]
#[must_use]
pub fn length(x: &[f64]) -> f64 {
    x[1..]
        .iter()
        .fold(x[0].abs(), |length, x| hypot(length, *x))
}

/// `a · b`, from the first entry to the last.
#[inline]
#[must_use]
pub fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = a[0] * b[0];
    for k in 1..D {
        sum += a[k] * b[k];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_has_three_velocities_in_the_plane_and_six_in_space() {
        assert_eq!([body_velocities(2), body_velocities(3)], [3, 6]);
        assert!((length(&[2.0, -3.0, 6.0]) - 7.0).abs() < 1e-15);
        assert!((length(&[-1.0]) - 1.0).abs() < 1e-15);
        assert!(length(&[1e200, 1e200]).is_finite());
        assert!((dot(&[1.0, 2.0, 3.0], &[4.0, -5.0, 6.0]) - 12.0).abs() < 1e-15);
    }
}
