//! Box on a plane: its corners.

use nalgebra::Vector3;

use super::SurfacePoint;
use crate::geometry::shape::oriented_box::signs;
use crate::geometry::{OrientedBox, Plane};

/// Visits corners whose gap is at most `reach`.
///
/// `base` (m, world) is where the box's coordinates have their origin. The
/// feature is the corner's number.
#[inline]
pub fn corners(
    solid: &OrientedBox,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let height = plane.distance(base) + plane.normal().dot(&solid.centre);
    // Heights of the three half edges; the lowest corner is `height − Σ |…|`.
    let rise = (solid.R.tr_mul(plane.normal())).component_mul(&solid.half_size);
    if height - rise.x.abs() - rise.y.abs() - rise.z.abs() > reach {
        return;
    }
    for feature in 0..8 {
        let gap = height + rise.dot(&signs(feature));
        if gap <= reach {
            visit(&SurfacePoint::of_normal(
                feature,
                solid.corner(feature),
                plane.normal(),
                gap,
            ));
        }
    }
}

/// The corner of a number, wherever it is.
#[inline]
#[must_use]
pub fn corner(
    solid: &OrientedBox,
    plane: &Plane,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    let point = solid.corner(feature);
    let gap = plane.distance(&(base + point));
    SurfacePoint::of_normal(feature, point, plane.normal(), gap)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn a_box_on_its_bottom_has_four_corners_down() {
        let solid = OrientedBox {
            centre: Vector3::zeros(),
            R: Matrix3::identity(),
            half_size: Vector3::new(0.6, 0.2, 0.5),
        };
        let mut found = Vec::new();
        let base = Vector3::new(0.0, 0.2, 0.0);
        corners(&solid, &Plane::ground(), &base, 1e-9, |p| {
            assert!(p.gap.abs() < 1e-15 && (p.point.y + 0.2).abs() < 1e-15);
            assert_eq!(*p, corner(&solid, &Plane::ground(), &base, p.feature));
            found.push(p.feature);
        });
        assert_eq!(found, [0, 1, 4, 5]);
        corners(&solid, &Plane::ground(), &(base * 2.0), 1e-9, |_| {
            panic!("nothing is near");
        });
    }
}
