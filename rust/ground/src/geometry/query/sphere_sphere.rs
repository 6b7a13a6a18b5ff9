//! Two spheres: the points on the line of centres, gap `|c₂ − c₁| − r₁ − r₂`.

use nalgebra::Vector3;

use super::{NEAREST, PairPoint, SurfacePoint};
use crate::geometry::Sphere;

/// Distance below which the line of centres has no direction, m.
const NO_DIRECTION: f64 = 1e-12;

/// Unit vector between the centres and their distance; up where there is none.
#[inline]
fn line(between: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let distance = between.norm();
    if distance > NO_DIRECTION {
        (between / distance, distance)
    } else {
        (Vector3::y(), distance)
    }
}

/// Nearest point of a sphere to one of the ground; `base` (m, world) is
/// where the first one's coordinates have their origin.
#[inline]
#[must_use]
pub fn nearest_point(sphere: &Sphere, ground: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let (n, distance) = line(&(sphere.centre - (ground.centre - base)));
    let point = sphere.centre - n * sphere.radius;
    SurfacePoint::of_normal(NEAREST, point, &n, distance - sphere.radius - ground.radius)
}

/// Nearest points of two spheres.
#[inline]
#[must_use]
pub fn nearest_points(first: &Sphere, second: &Sphere) -> PairPoint {
    let (n, distance) = line(&(second.centre - first.centre));
    let gap = distance - first.radius - second.radius;
    PairPoint::from_first(NEAREST, &(first.centre + n * first.radius), &n, gap)
}

/// The sphere's point over the tangent plane (normal n) at the point
/// `touch` where a sphere of the ground was first met.
#[inline]
#[must_use]
pub fn point_over_tangent(sphere: &Sphere, n: &Vector3<f64>, touch: &Vector3<f64>) -> SurfacePoint {
    let point = sphere.centre - n * sphere.radius;
    SurfacePoint::of_normal(NEAREST, point, n, n.dot(&(point - touch)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_points_are_on_both_and_none_are_nearer(
            a in prop::array::uniform3(-1.0..1.0), b in prop::array::uniform3(-1.0..1.0), d in prop::array::uniform3(-1.0..1.0),
        ) {
            let first = Sphere { centre: a.into(), radius: 0.3 };
            let second = Sphere { centre: b.into(), radius: 0.2 };
            let near = nearest_points(&first, &second);
            prop_assert!(first.distance(&near.on_first()).abs() < 1e-12);
            prop_assert!(second.distance(&near.on_second()).abs() < 1e-12);
            let other = first.centre + Vector3::from(d).try_normalize(1e-3).unwrap_or_else(Vector3::y) * first.radius;
            prop_assert!(near.gap <= second.distance(&other) + 1e-12);
            let base = Vector3::new(1.0, 2.0, 3.0);
            let ground = Sphere { centre: second.centre + base, ..second };
            let surface = nearest_point(&first, &ground, &base);
            prop_assert!((surface.gap - near.gap).abs() < 1e-12 && (surface.n + near.n).norm() < 1e-12);
            prop_assert!((surface.point - near.on_first()).norm() < 1e-12);
        }
    }
}
