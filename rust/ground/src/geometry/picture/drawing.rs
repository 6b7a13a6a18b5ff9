//! What is drawn of a solid: coloured triangles in its frame, with a normal at each corner, between
//! which the shading changes smoothly (Phong 1975).

use nalgebra::{Matrix3, Vector3};

use super::Colour;
use crate::geometry::broad_phase::{Bounds, BoxTree};
use crate::geometry::ray::triangle::Sheared;
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::Sphere;

/// Coloured triangles that any ray may meet from either side. Immutable.
#[derive(Clone, Debug)]
pub struct Drawing {
    corners: Vec<[Vector3<f64>; 3]>,
    /// Unit normals at the corners, for shading.
    normals: Vec<[Vector3<f64>; 3]>,
    colours: Vec<Colour>,
    boxes: BoxTree,
    /// A ball around all triangles.
    around: Sphere,
}

impl Drawing {
    /// From the corners of triangles (m), the normals at these, and a colour for each; triangles
    /// without an area are left out. None if no triangle is left.
    #[must_use]
    pub fn new(triangles: &[[f64; 9]], normals: &[[f64; 9]], colours: &[Colour]) -> Option<Self> {
        let three = |flat: &[f64; 9]| -> [Vector3<f64>; 3] {
            std::array::from_fn(|k| Vector3::from_column_slice(&flat[3 * k..3 * k + 3]))
        };
        let (mut corners, mut shading, mut kept) = (Vec::new(), Vec::new(), Vec::new());
        for ((triangle, normals), colour) in triangles.iter().zip(normals).zip(colours) {
            let triangle = three(triangle);
            if normal(&triangle).is_some() {
                corners.push(triangle);
                shading.push(three(normals));
                kept.push(*colour);
            }
        }
        let of_corner = |x: &Vector3<f64>| Bounds { low: *x, high: *x };
        let bounds = |triangle: &[Vector3<f64>; 3]| {
            let each = triangle.iter().map(of_corner);
            each.fold(Bounds::NOTHING, |all, one| all.with(&one))
        };
        let boxes: Vec<Bounds> = corners.iter().map(bounds).collect();
        let whole = boxes.iter().copied().reduce(|all, one| all.with(&one))?;
        let centre = 0.5 * (whole.low + whole.high);
        let far = |x: &Vector3<f64>| (x - centre).norm();
        let radius = corners.iter().flatten().map(far).fold(0.0, f64::max);
        Some(Self {
            boxes: BoxTree::new(&boxes),
            corners,
            normals: shading,
            colours: kept,
            around: Sphere::new(centre, radius),
        })
    }

    /// With the solid's origin (world, m) and its rotation to the world.
    #[must_use]
    pub fn placed(&self, origin: Vector3<f64>, rotation: Matrix3<f64>) -> PlacedDrawing<'_> {
        let centre = origin + rotation * self.around.centre;
        PlacedDrawing {
            around: Sphere::new(centre, self.around.radius),
            drawing: self,
            origin,
            rotation,
        }
    }
}

/// Unit normal of a triangle; none without an area.
fn normal([a, b, c]: &[Vector3<f64>; 3]) -> Option<Vector3<f64>> {
    (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE)
}

/// Unit vector at a place of a triangle with this normal, between the vectors at its corners.
fn between(
    [a, b, c]: &[Vector3<f64>; 3],
    [at_a, at_b, at_c]: &[Vector3<f64>; 3],
    place: &Vector3<f64>,
    normal: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let area = |p: &Vector3<f64>, q: &Vector3<f64>| (p - place).cross(&(q - place)).dot(normal);
    let sum = at_a * area(b, c) + at_b * area(c, a) + at_c * area(a, b);
    sum.try_normalize(f64::MIN_POSITIVE)
}

/// A drawing in the world.
#[derive(Clone, Debug)]
pub struct PlacedDrawing<'a> {
    drawing: &'a Drawing,
    origin: Vector3<f64>,
    rotation: Matrix3<f64>,
    /// A ball around it, world, m.
    pub around: Sphere,
}

impl PlacedDrawing<'_> {
    /// The triangle that a ray meets first within `reach` (m), with the unit normal of its shading
    /// there and its colour.
    #[must_use]
    pub fn first_hit(&self, ray: &Ray, reach: f64) -> Option<(Hit, Vector3<f64>, Colour)> {
        if !may_meet(ray, &self.around, reach) {
            return None;
        }
        let from_solid = Ray {
            origin: self.rotation.tr_mul(&(ray.origin - self.origin)),
            direction: self.rotation.tr_mul(&ray.direction),
        };
        let (sheared, mut nearest) = (Sheared::new(&from_solid), None);
        let drawing = self.drawing;
        drawing.boxes.visit_along(&from_solid, reach, |t, reach| {
            let Some(distance) = sheared.distance(&drawing.corners[t as usize], reach) else {
                return reach;
            };
            nearest = Some((distance, t as usize));
            distance
        });
        let (distance, t) = nearest?;
        let (corners, place) = (&drawing.corners[t], from_solid.at(distance));
        let normal = normal(corners)?;
        let shading = between(corners, &drawing.normals[t], &place, &normal).unwrap_or(normal);
        let hit = Hit {
            distance,
            normal: self.rotation * normal,
        };
        Some((hit, self.rotation * shading, drawing.colours[t]))
    }
}

/// Whether a ray comes into a ball within `reach` (m).
#[inline]
#[must_use]
pub fn may_meet(ray: &Ray, ball: &Sphere, reach: f64) -> bool {
    let to_centre = ball.centre - ray.origin;
    let along = to_centre.dot(&ray.direction);
    let across = to_centre - ray.direction * along;
    let radius = ball.radius * (1.0 + 1e-9);
    along > -radius && along - radius < reach && across.norm_squared() <= radius * radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::oriented_box;
    use crate::geometry::shape::OrientedBox;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    /// The faces of a box about the origin, each of two triangles, in a colour that tells its axis
    /// and side.
    fn faces(half: &Vector3<f64>) -> Drawing {
        let (mut triangles, mut normals, mut colours) = (Vec::new(), Vec::new(), Vec::new());
        for axis in 0..3_u8 {
            for side in [-1.0, 1.0] {
                let k = usize::from(axis);
                let corner = |u: f64, v: f64| {
                    let mut x = Vector3::zeros();
                    (x[k], x[(k + 1) % 3], x[(k + 2) % 3]) = (side, u, v);
                    x.component_mul(half)
                };
                let outward = Vector3::ith(k, side);
                let [a, b, c, d] =
                    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| corner(u, v));
                for corners in [[a, b, c], [a, c, d]] {
                    triangles.push(std::array::from_fn(|i| corners[i / 3][i % 3]));
                    normals.push(std::array::from_fn(|i| outward[i % 3]));
                    colours.push([f64::from(axis), side, 0.0]);
                }
            }
        }
        Drawing::new(&triangles, &normals, &colours).unwrap()
    }

    proptest! {
        #[test]
        fn the_faces_of_a_box_are_met_where_the_box_is(
            angles in prop::array::uniform3(-3.0..3.0), place in prop::array::uniform3(-1.0..1.0),
            origin in prop::array::uniform3(-3.0..3.0), target in prop::array::uniform3(-0.5..0.5),
        ) {
            let half = Vector3::new(0.5, 0.2, 0.8);
            let R = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
            let centre = Vector3::from(place);
            let solid = OrientedBox { centre, R, half_size: half };
            let drawing = faces(&half);
            let drawn = drawing.placed(centre, R);
            let origin = Vector3::from(origin);
            let Some(ray) = Ray::new(origin, centre + Vector3::from(target) - origin) else { return Ok(()) };
            match (drawn.first_hit(&ray, 9.0), oriented_box::hit(&ray, &solid, 9.0)) {
                (Some((hit, shading, [axis, side, _])), Some(expected)) => {
                    prop_assert!((hit.distance - expected.distance).abs() < 1e-9);
                    let outward = R * Vector3::from_fn(|k, _| if (k as f64 - axis).abs() < 0.5 { side } else { 0.0 });
                    prop_assert!((shading - outward).norm() < 1e-9);
                    prop_assert!((hit.normal.dot(&outward).abs() - 1.0).abs() < 1e-9);
                    let local = R.tr_mul(&(ray.at(hit.distance) - centre)).component_div(&half);
                    prop_assert!((local.amax() - 1.0).abs() < 1e-9);
                }
                (None, None) => {}
                (found, expected) => prop_assert!(false, "{found:?} {expected:?}"),
            }
        }
    }

    #[test]
    fn triangles_without_an_area_are_left_out() {
        let flat = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0];
        let up = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
        assert!(Drawing::new(&[flat], &[up], &[[1.0; 3]]).is_none());
        let upright = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let drawing = Drawing::new(&[flat, upright], &[up; 2], &[[0.0; 3], [1.0; 3]]).unwrap();
        let ray = Ray::new(Vector3::new(0.2, 0.2, 3.0), -Vector3::z()).unwrap();
        let (hit, _, colour) = drawing
            .placed(Vector3::z(), Matrix3::identity())
            .first_hit(&ray, 9.0)
            .unwrap();
        assert!((hit.distance - 2.0).abs() < 1e-12);
        assert!((colour[0] - 1.0).abs() < 1e-15);
    }
}
