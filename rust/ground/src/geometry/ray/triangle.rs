//! Rays and triangles without gaps between neighbours.
//!
//! The triangle is sheared and scaled so that the ray is the axis `(0, 0, 1)`. Whether the axis
//! passes then follows from the signs of three products of the other coordinates. Two triangles
//! compute the same number, but for its sign, for the edge that they share, so a ray through it
//! meets at least one of them.
//!
//! Source: Woop, Benthin and Wald 2013, *Watertight ray/triangle intersection*, JCGT 2 (1).

use nalgebra::Vector3;

use super::Ray;

/// A ray as the axis of sheared coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Sheared {
    origin: Vector3<f64>,
    axes: [usize; 3],
    shear: Vector3<f64>,
}

impl Sheared {
    /// Shears the coordinates so that a ray is their axis.
    #[inline]
    #[must_use]
    pub fn new(ray: &Ray) -> Self {
        let z = ray.direction.iamax();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let along = ray.direction[z];
        Self {
            origin: ray.origin,
            axes: [x, y, z],
            shear: Vector3::new(ray.direction[x], ray.direction[y], 1.0) / along,
        }
    }

    /// Distance (m) at which the ray crosses a triangle within `reach` (m), from either side.
    #[inline]
    #[must_use]
    pub fn distance(&self, corners: &[Vector3<f64>; 3], reach: f64) -> Option<f64> {
        let [x, y, z] = self.axes;
        let place = |corner: &Vector3<f64>| {
            let from = corner - self.origin;
            let along = from[z];
            [
                from[x] - self.shear.x * along,
                from[y] - self.shear.y * along,
                self.shear.z * along,
            ]
        };
        let [a, b, c] = [&corners[0], &corners[1], &corners[2]].map(place);
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let sum = u + v + w;
        let distance = (u * a[2] + v * b[2] + w * c[2]) / sum;
        (distance >= 0.0 && distance <= reach).then_some(distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn a_triangle_is_met_where_its_plane_is_within_its_edges(
            corners in prop::array::uniform3(point()), origin in point(), target in point(),
        ) {
            let [a, b, c] = corners;
            let normal = (b - a).cross(&(c - a));
            let Some(ray) = Ray::new(origin * 3.0, target - origin * 3.0) else { return Ok(()) };
            prop_assume!(normal.norm() > 1e-3 && normal.normalize().dot(&ray.direction).abs() > 1e-3);
            let t = normal.dot(&(a - ray.origin)) / normal.dot(&ray.direction);
            let place = ray.at(t);
            let inward = [(a, b), (b, c), (c, a)].map(|(p, q)| normal.cross(&(q - p)).dot(&(place - p)));
            let least = inward.iter().fold(f64::INFINITY, |x, y| x.min(*y));
            prop_assume!(least.abs() > 1e-12);
            match Sheared::new(&ray).distance(&corners, 10.0) {
                Some(distance) => prop_assert!(least > 0.0 && (distance - t).abs() < 1e-9),
                None => prop_assert!(least < 0.0 || !(0.0..=10.0).contains(&t)),
            }
        }

        /// A ray through the edge of two triangles slipped between them.
        #[test]
        fn no_ray_passes_between_two_triangles(
            corners in prop::array::uniform4(point()), origin in point(), share in 0.0..1.0,
        ) {
            let [a, b, mut c, mut d] = corners;
            (c.x, d.x) = (-1.5, 1.5);
            let [a, b] = [Vector3::new(0.0, a.y, -1.0), Vector3::new(0.0, b.y, 1.0)];
            let from = Vector3::new(origin.x, 5.0 + origin.y, origin.z);
            let ray = Ray::new(from, a + (b - a) * share - from).unwrap();
            let sheared = Sheared::new(&ray);
            let met = [[a, b, c], [b, a, d]].map(|corners| sheared.distance(&corners, 20.0));
            prop_assert!(met[0].or(met[1]).is_some());
        }
    }
}
