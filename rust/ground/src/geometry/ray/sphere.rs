//! A ray and a sphere: the near or, from within, the far root of `|o + t e − a| = r`.

use nalgebra::Vector3;

use super::{Hit, Ray};
use crate::geometry::shape::Sphere;

/// Distance (m) at which a ray crosses a sphere within `reach` (m).
///
/// The distance of the line from the centre is measured across the ray, not as a difference of
/// squares, so that a far sphere loses no digits.
#[inline]
#[must_use]
pub fn distance(ray: &Ray, sphere: &Sphere, reach: f64) -> Option<f64> {
    let to_centre = sphere.centre - ray.origin;
    let along = to_centre.dot(&ray.direction);
    let across = to_centre - ray.direction * along;
    let rest = sphere.radius * sphere.radius - across.norm_squared();
    if rest < 0.0 {
        return None;
    }
    let half = rest.sqrt();
    let near = along - half;
    let distance = if near >= 0.0 { near } else { along + half };
    (distance >= 0.0 && distance <= reach).then_some(distance)
}

/// Distance at which a ray hits a sphere within `reach` (m), and the normal there.
#[inline]
#[must_use]
pub fn hit(ray: &Ray, sphere: &Sphere, reach: f64) -> Option<Hit> {
    distance(ray, sphere, reach).map(|distance| hit_at(ray, sphere, distance))
}

/// The hit at a distance on a sphere.
#[inline]
#[must_use]
pub fn hit_at(ray: &Ray, sphere: &Sphere, distance: f64) -> Hit {
    let out: Vector3<f64> = ray.at(distance) - sphere.centre;
    Hit {
        distance,
        normal: out / sphere.radius,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_place_is_on_the_sphere_and_nothing_of_it_lies_before(
            centre in prop::array::uniform3(-2.0..2.0), size in -4.0..1.0,
            origin in prop::array::uniform3(-3.0..3.0), direction in prop::array::uniform3(-1.0..1.0),
        ) {
            let sphere = Sphere { centre: centre.into(), radius: f64::exp(size) };
            let Some(ray) = Ray::new(Vector3::from(origin), Vector3::from(direction)) else { return Ok(()) };
            let starts_in = sphere.distance(&ray.origin) < 0.0;
            let met = distance(&ray, &sphere, 10.0);
            let until = met.unwrap_or(10.0);
            for k in 0..100 {
                let here = sphere.distance(&ray.at(until * f64::from(k) / 100.0));
                let outside = if starts_in { -here } else { here };
                prop_assert!(outside > -1e-9);
            }
            if let Some(hit) = met.map(|t| hit_at(&ray, &sphere, t)) {
                prop_assert!(sphere.distance(&ray.at(hit.distance)).abs() < 1e-12);
                prop_assert!((hit.normal.norm() - 1.0).abs() < 1e-9);
                prop_assert!((hit.normal.dot(&ray.direction) <= 1e-6) != starts_in || hit.distance < 1e-6);
            }
        }
    }
}
