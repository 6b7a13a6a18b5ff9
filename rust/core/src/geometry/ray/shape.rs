//! A ray and the shape of a part.

use super::{Hit, Ray, disc, oriented_box, roller, sphere};
use crate::geometry::shape::{PlacedShape, SupportMap};

/// What a ray meets first of a part, within `reach` (m).
#[must_use]
pub fn hit(ray: &Ray, shape: &PlacedShape, reach: f64) -> Option<Hit> {
    let to_centre = shape.centre() - ray.origin;
    let across = to_centre - ray.direction * to_centre.dot(&ray.direction);
    let bound = shape.bound();
    if across.norm_squared() > bound * bound * (1.0 + 1e-12) {
        return None;
    }
    match shape {
        PlacedShape::Disc(wheel) => disc::hit(ray, wheel, reach),
        PlacedShape::Roller(wheel) => roller::hit(ray, wheel, reach),
        PlacedShape::Box(solid) => oriented_box::hit(ray, solid, reach),
        PlacedShape::Sphere(ball) => sphere::hit(ray, ball, reach),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::{Disc, OrientedBox, Roller, Sphere};
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    /// Whether a place is in a shape, beyond its support planes in none of many directions.
    fn is_in(shape: &PlacedShape, x: &Vector3<f64>, slack: f64) -> bool {
        let n = 2000;
        (0..n).all(|k| {
            // Fibonacci's lattice on the unit sphere.
            let y = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(n);
            let around = 2.399_963_229_728_653 * f64::from(k);
            let r = (1.0 - y * y).sqrt();
            let d = Vector3::new(r * around.cos(), y, r * around.sin());
            d.dot(&(x - shape.support(&d))) <= slack
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn the_place_is_on_the_shape_and_what_lies_before_it_is_outside(
            angles in prop::array::uniform3(-3.0..3.0), rounding in prop_oneof![Just(0.0), 0.01..0.1, Just(0.1)],
            origin in prop::array::uniform3(-2.0..2.0), target in prop::array::uniform3(-0.4..0.4),
        ) {
            let R = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
            let centre = Vector3::new(0.05, -0.1, 0.1);
            let wheel = Disc { centre, axle: R.column(2).into(), spoke: R.column(0).into(), radius: 0.35 };
            let shapes = [
                PlacedShape::Roller(Roller::new(wheel, 0.2, rounding)),
                PlacedShape::Box(OrientedBox { centre, R, half_size: Vector3::new(0.4, 0.2, 0.1) }),
                PlacedShape::Sphere(Sphere { centre, radius: 0.3 }),
            ];
            let origin = Vector3::from(origin);
            let Some(ray) = Ray::new(origin, Vector3::from(target) - origin) else { return Ok(()) };
            for shape in shapes {
                if is_in(&shape, &origin, 0.0) {
                    continue;
                }
                let met = hit(&ray, &shape, 10.0);
                let until = met.map_or(5.0, |hit| hit.distance);
                for k in 0..20 {
                    let before = ray.at((until - 0.01) * f64::from(k) / 20.0);
                    // Of sampled planes a few millimetres miss where the surface is curved.
                    prop_assert!(!is_in(&shape, &before, -0.01), "{shape:?}");
                }
                if let Some(hit) = met {
                    let place = ray.at(hit.distance);
                    prop_assert!(is_in(&shape, &place, 1e-9), "{shape:?}");
                    let furthest = hit.normal.dot(&(shape.support(&hit.normal) - place));
                    prop_assert!(furthest.abs() < 1e-8, "{shape:?} {furthest}");
                    prop_assert!(hit.normal.dot(&ray.direction) <= 0.0);
                }
            }
        }
    }

    #[test]
    fn a_disc_is_met_from_both_sides_and_its_edge_on_is_not() {
        let wheel = PlacedShape::Disc(Disc {
            centre: Vector3::zeros(),
            axle: Vector3::z(),
            spoke: Vector3::x(),
            radius: 0.5,
        });
        for side in [-1.0, 1.0] {
            let from = Vector3::new(0.1, 0.2, side);
            let ray = Ray::new(from, -Vector3::z() * side).unwrap();
            let found = hit(&ray, &wheel, 2.0).unwrap();
            assert!((found.distance - 1.0).abs() < 1e-15);
            assert!((found.normal - Vector3::z() * side).norm() < 1e-15);
            assert_eq!(hit(&ray, &wheel, 0.9), None);
        }
        let edge_on = Ray::new(-Vector3::x(), Vector3::x()).unwrap();
        assert_eq!(hit(&edge_on, &wheel, 2.0), None);
    }

    #[test]
    fn from_within_a_box_its_far_side_is_met() {
        let solid = PlacedShape::Box(OrientedBox {
            centre: Vector3::zeros(),
            R: nalgebra::Matrix3::identity(),
            half_size: Vector3::new(1.0, 2.0, 3.0),
        });
        let ray = Ray::new(Vector3::zeros(), -Vector3::y()).unwrap();
        let found = hit(&ray, &solid, 5.0).unwrap();
        assert!((found.distance - 2.0).abs() < 1e-15);
        assert!((found.normal + Vector3::y()).norm() < 1e-15);
    }
}
