//! A ray and a plane: `t = −(n · o + d) / (n · e)`.

use super::{Hit, Ray};
use crate::geometry::terrain::Plane;

/// Where a ray crosses a plane within `reach` (m), from either side.
#[inline]
#[must_use]
pub fn hit(ray: &Ray, plane: &Plane, reach: f64) -> Option<Hit> {
    let distance = -plane.distance(&ray.origin) / plane.normal().dot(&ray.direction);
    (distance >= 0.0 && distance <= reach).then(|| Hit {
        distance,
        normal: *plane.normal(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_place_is_on_the_plane_and_what_is_missed_stays_on_one_side(
            normal in prop::array::uniform3(-1.0..1.0), offset in -3.0..3.0,
            origin in prop::array::uniform3(-3.0..3.0), direction in prop::array::uniform3(-1.0..1.0),
        ) {
            let Ok(plane) = Plane::new(normal, offset) else { return Ok(()) };
            let Some(ray) = Ray::new(Vector3::from(origin), Vector3::from(direction)) else { return Ok(()) };
            let (before, after) = (plane.distance(&ray.origin), plane.distance(&ray.at(50.0)));
            match hit(&ray, &plane, 50.0) {
                Some(hit) => prop_assert!(plane.distance(&ray.at(hit.distance)).abs() < 1e-12 * (1.0 + hit.distance)),
                None => prop_assert!(before * after > 0.0),
            }
        }
    }

    #[test]
    fn along_the_plane_nothing_is_met() {
        let ray = Ray::new(Vector3::y(), Vector3::x()).unwrap();
        assert_eq!(hit(&ray, &Plane::ground(), f64::INFINITY), None);
        let within = Ray::new(Vector3::zeros(), Vector3::x()).unwrap();
        assert_eq!(hit(&within, &Plane::ground(), f64::INFINITY), None);
    }
}
