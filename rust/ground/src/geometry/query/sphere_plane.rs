//! Sphere on a plane: its lowest point, `E = c − r n`, gap `n·c + d − r`.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint};
use crate::geometry::{Plane, Sphere};

/// The lowest point; `base` (m, world) is where the sphere's coordinates have their origin.
#[inline]
#[must_use]
pub fn lowest_point(sphere: &Sphere, plane: &Plane, base: &Vector3<f64>) -> SurfacePoint {
    let n = plane.normal();
    let height = plane.distance(base) + n.dot(&sphere.centre);
    let point = sphere.centre - n * sphere.radius;
    SurfacePoint::of_normal(NEAREST, point, n, height - sphere.radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_point_of_the_sphere_is_lower(
            c in prop::array::uniform3(-1.0..1.0), d in prop::array::uniform3(-1.0..1.0), tilt in -0.5..0.5,
        ) {
            let plane = Plane::new([tilt, 1.0, -tilt], 0.2).unwrap();
            let sphere = Sphere { centre: c.into(), radius: 0.3 };
            let base = Vector3::new(1.0, 2.0, 3.0);
            let low = lowest_point(&sphere, &plane, &base);
            prop_assert!((plane.distance(&(base + low.point)) - low.gap).abs() < 1e-12);
            prop_assert!(sphere.distance(&low.point).abs() < 1e-12);
            let other = sphere.centre + Vector3::from(d).try_normalize(1e-3).unwrap_or_else(Vector3::y) * sphere.radius;
            prop_assert!(low.gap <= plane.distance(&(base + other)) + 1e-12);
        }
    }
}
