//! Box on a plane: its corners.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::Plane;

/// Visits corners (number, place, gap) whose gap is at most `reach`.
///
/// `centre` relative to `base`, `R` from the box's axes to the world's, `half_size` m. Corner bits 0, 1, 2 say the
/// side along x, y, z.
#[inline]
pub fn corners(
    centre: &Vector3<f64>,
    R: &Matrix3<f64>,
    half_size: &Vector3<f64>,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(usize, Vector3<f64>, f64),
) {
    let height = plane.distance(base) + plane.normal().dot(centre);
    // Heights of the three half edges; the lowest corner is `height − Σ |…|`.
    let rise = R.tr_mul(plane.normal()).component_mul(half_size);
    if height - rise.x.abs() - rise.y.abs() - rise.z.abs() > reach {
        return;
    }
    for feature in 0..8 {
        let gap = height + rise.dot(&signs(feature));
        if gap <= reach {
            visit(feature, corner(centre, R, half_size, feature), gap);
        }
    }
}

/// Place of the corner of a number, relative to what `centre` is relative to.
#[inline]
#[must_use]
pub fn corner(
    centre: &Vector3<f64>,
    R: &Matrix3<f64>,
    half_size: &Vector3<f64>,
    feature: usize,
) -> Vector3<f64> {
    centre + R * half_size.component_mul(&signs(feature))
}

fn signs(feature: usize) -> Vector3<f64> {
    let sign = |bit: usize| if feature >> bit & 1 == 1 { 1.0 } else { -1.0 };
    Vector3::new(sign(0), sign(1), sign(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_on_its_bottom_has_four_corners_down() {
        let half = Vector3::new(0.6, 0.2, 0.5);
        let mut found = Vec::new();
        let base = Vector3::new(0.0, 0.2, 0.0);
        corners(
            &Vector3::zeros(),
            &Matrix3::identity(),
            &half,
            &Plane::ground(),
            &base,
            1e-9,
            |k, p, gap| {
                assert!(gap.abs() < 1e-15 && (p.y + 0.2).abs() < 1e-15);
                found.push(k);
            },
        );
        assert_eq!(found, [0, 1, 4, 5]);
        corners(
            &Vector3::zeros(),
            &Matrix3::identity(),
            &half,
            &Plane::ground(),
            &(base * 2.0),
            1e-9,
            |_, _, _| {
                panic!("nothing is near");
            },
        );
    }
}
