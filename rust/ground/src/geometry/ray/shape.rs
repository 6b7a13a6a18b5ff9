//! A ray and the shape of a part.

use super::{Hit, Ray, disc, ellipsoid, hull, oriented_box, roller, sphere};
use crate::geometry::shape::{PlacedShape, SupportMap};

/// What a ray meets first of a part, within `reach` (m).
#[must_use]
pub fn hit(ray: &Ray, shape: &PlacedShape<'_>, reach: f64) -> Option<Hit> {
    let to_centre = shape.centre() - ray.origin;
    let across = to_centre - ray.direction * to_centre.dot(&ray.direction);
    let bound = shape.bound();
    if across.norm_squared() > bound * bound * (1.0 + 1e-12) {
        return None;
    }
    match shape {
        PlacedShape::Disc(wheel) => disc::hit(ray, wheel, reach),
        PlacedShape::Roller(wheel) | PlacedShape::Cylinder(wheel) => roller::hit(ray, wheel, reach),
        PlacedShape::Box(solid) => oriented_box::hit(ray, solid, reach),
        PlacedShape::Sphere(ball) => sphere::hit(ray, ball, reach),
        PlacedShape::Ellipsoid(solid) => ellipsoid::hit(ray, solid, reach),
        PlacedShape::Hull(solid) => hull::hit(ray, solid, reach),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::ellipsoid_sphere;
    use crate::geometry::shape::{Disc, Ellipsoid, Hull, OrientedBox, Roller, Sphere};
    use crate::spatial::Polytope;
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    /// How far a place lies from a shape, or in it (negative), m. In a box, how far from its faces.
    fn distance(shape: &PlacedShape<'_>, x: &Vector3<f64>) -> f64 {
        let outside = |along: &[f64]| {
            let beyond = along.iter().map(|s| s.max(0.0).powi(2)).sum::<f64>().sqrt();
            let depth = along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if depth > 0.0 { beyond } else { depth }
        };
        match shape {
            PlacedShape::Sphere(ball) => (x - ball.centre).norm() - ball.radius,
            PlacedShape::Box(solid) => {
                let local = solid.R.transpose() * (x - solid.centre);
                outside((local.abs() - solid.half_size).as_slice())
            }
            PlacedShape::Roller(wheel) | PlacedShape::Cylinder(wheel) => {
                let from = x - wheel.core.centre;
                let axial = from.dot(&wheel.core.axle);
                let radial = (from - wheel.core.axle * axial).norm();
                outside(&[axial.abs() - wheel.half, radial - wheel.core.radius]) - wheel.rounding
            }
            PlacedShape::Ellipsoid(solid) => {
                let place = Sphere::new(*x, 0.0);
                ellipsoid_sphere::nearest_point(solid, &place, &Vector3::zeros()).gap
            }
            PlacedShape::Hull(solid) => solid.outermost(&solid.local(x)).1,
            PlacedShape::Disc(_) => unreachable!("a disc has no inside"),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn the_place_is_on_the_shape_and_what_lies_before_it_is_outside(
            angles in prop::array::uniform3(-3.0..3.0), rounding in prop_oneof![Just(0.0), 0.01..0.1, Just(0.1)],
            origin in prop::array::uniform3(-2.0..2.0), target in prop::array::uniform3(-0.4..0.4),
        ) {
            let R = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
            let centre = Vector3::new(0.05, -0.1, 0.1);
            let wheel = Disc { centre, axle: R.column(2).into(), spoke: R.column(0).into(), radius: 0.35 };
            let points = [[0.3, 0.0, 0.0], [-0.3, 0.1, 0.2], [0.0, -0.3, 0.1], [0.1, 0.2, -0.3], [0.0, 0.3, 0.3]];
            let polytope = Polytope::hull_of(&points.map(Vector3::from)).unwrap();
            let shapes = [
                PlacedShape::Roller(Roller::new(wheel, 0.2, rounding)),
                PlacedShape::Box(OrientedBox { centre, R, half_size: Vector3::new(0.4, 0.2, 0.1) }),
                PlacedShape::Sphere(Sphere { centre, radius: 0.3 }),
                PlacedShape::Cylinder(Roller::new(Disc { radius: 0.1, ..wheel }, 0.6, 0.1)),
                PlacedShape::Ellipsoid(Ellipsoid { centre, R, radii: Vector3::new(0.4, 0.2, 0.3) }),
                PlacedShape::Hull(Hull { centre, R, polytope: &polytope }),
            ];
            let origin = Vector3::from(origin);
            let Some(ray) = Ray::new(origin, Vector3::from(target) - origin) else { return Ok(()) };
            for shape in shapes {
                if distance(&shape, &origin) <= 0.0 {
                    continue;
                }
                let met = hit(&ray, &shape, 10.0);
                let until = met.map_or(5.0, |hit| hit.distance);
                for k in 0..20 {
                    let before = ray.at(until * f64::from(k) / 20.0);
                    prop_assert!(distance(&shape, &before) > -1e-9, "{shape:?}");
                }
                if let Some(hit) = met {
                    let place = ray.at(hit.distance);
                    prop_assert!(distance(&shape, &place).abs() < 1e-8, "{shape:?}");
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
