//! Chooses the module that measures a pair of shapes. No other place knows all pairs.
//!
//! A new shape adds its arms here; see "add a shape" in `CONTRIBUTING.md`.

use nalgebra::Vector3;

use super::{
    NEAREST, PairPoint, SurfacePoint, box_box, box_plane, box_sphere, box_triangle, convex,
    disc_box, disc_disc, disc_plane, disc_sphere, disc_triangle, roller_plane, roller_sphere,
    roller_triangle, sphere_plane, sphere_sphere, sphere_triangle,
};
use crate::geometry::terrain::surface::{Edge, Face, Vertex};
use crate::geometry::{PlacedShape, Plane, Sphere};

/// Visits the points of a shape over a plane of the ground whose gap is at most `reach`, m.
///
/// `base` (m, world) is where the shape's coordinates have their origin, here and below.
#[inline]
pub fn visit_on_plane(
    shape: &PlacedShape,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    match shape {
        PlacedShape::Disc(disc) => disc_plane::rim_points(disc, plane, base, reach, visit),
        PlacedShape::Roller(roller) => {
            roller_plane::rim_points(roller, plane, base, reach, visit);
        }
        PlacedShape::Box(solid) => box_plane::corners(solid, plane, base, reach, visit),
        PlacedShape::Sphere(sphere) => {
            let low = sphere_plane::lowest_point(sphere, plane, base);
            if low.gap <= reach {
                visit(&low);
            }
        }
    }
}

/// The point of a feature over a plane of the ground, wherever it is.
#[inline]
#[must_use]
pub fn point_on_plane(
    shape: &PlacedShape,
    plane: &Plane,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_plane::rim_point(disc, plane, base, feature),
        PlacedShape::Roller(roller) => roller_plane::rim_point(roller, plane, base, feature),
        PlacedShape::Box(solid) => box_plane::corner(solid, plane, base, feature),
        PlacedShape::Sphere(sphere) => sphere_plane::lowest_point(sphere, plane, base),
    }
}

/// The lowest point of a wheel over a plane of the ground.
#[inline]
#[must_use]
pub fn lowest_on_plane(shape: &PlacedShape, plane: &Plane, base: &Vector3<f64>) -> SurfacePoint {
    match shape {
        PlacedShape::Roller(roller) => roller_plane::lowest_point(roller, plane, base),
        _ => point_on_plane(shape, plane, base, NEAREST),
    }
}

/// Nearest point of a shape to a sphere of the ground.
#[inline]
#[must_use]
pub fn point_on_sphere(shape: &PlacedShape, ground: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_sphere::nearest_point(disc, ground, base),
        PlacedShape::Roller(roller) => roller_sphere::nearest_point(roller, ground, base),
        PlacedShape::Box(solid) => box_sphere::nearest_point(solid, ground, base),
        PlacedShape::Sphere(sphere) => sphere_sphere::nearest_point(sphere, ground, base),
    }
}

/// Visits the points of a shape over a face of a surface whose gap is at most `reach`, m.
#[inline]
pub fn visit_on_face(
    shape: &PlacedShape,
    face: &Face,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    match shape {
        PlacedShape::Disc(disc) => {
            disc_triangle::rim_points_over_face(disc, face, base, reach, visit);
        }
        PlacedShape::Roller(roller) => {
            roller_triangle::rim_points_over_face(roller, face, base, reach, visit);
        }
        PlacedShape::Box(solid) => {
            box_triangle::corners_over_face(solid, face, base, reach, visit);
        }
        PlacedShape::Sphere(sphere) => {
            let low = sphere_triangle::lowest_over_face(sphere, face, base);
            if let Some(low) = low.filter(|low| low.gap <= reach) {
                visit(&low);
            }
        }
    }
}

/// Visits the points of a shape at a convex edge of a surface whose gap is at most `reach`, m.
#[inline]
pub fn visit_at_edge(
    shape: &PlacedShape,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let point = match shape {
        PlacedShape::Disc(disc) => disc_triangle::rim_point_at_edge(disc, edge, base),
        PlacedShape::Roller(roller) => {
            roller_triangle::points_at_edge(roller, edge, base, reach, visit);
            return;
        }
        PlacedShape::Box(solid) => {
            box_triangle::crossings(solid, edge, base, reach, visit);
            return;
        }
        PlacedShape::Sphere(sphere) => sphere_triangle::point_at_edge(sphere, edge, base),
    };
    if let Some(point) = point.filter(|point| point.gap <= reach) {
        visit(&point);
    }
}

/// The point of a feature at a convex edge of a surface, wherever it is.
#[inline]
#[must_use]
pub fn point_at_edge(
    shape: &PlacedShape,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_triangle::nearest_at_edge(disc, edge, base),
        PlacedShape::Roller(roller) => roller_triangle::point_at_edge(roller, edge, base, feature),
        PlacedShape::Box(solid) => box_triangle::point_at_edge(solid, edge, base, feature),
        PlacedShape::Sphere(sphere) => sphere_triangle::nearest_at_edge(sphere, edge, base),
    }
}

/// The point of a shape at a convex vertex of a surface, wherever it is.
#[inline]
#[must_use]
pub fn point_at_vertex(shape: &PlacedShape, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_triangle::nearest_at_vertex(disc, vertex, base),
        PlacedShape::Roller(roller) => roller_triangle::nearest_at_vertex(roller, vertex, base),
        PlacedShape::Box(solid) => box_triangle::nearest_at_vertex(solid, vertex, base),
        PlacedShape::Sphere(sphere) => sphere_triangle::nearest_at_vertex(sphere, vertex, base),
    }
}

/// A shape's point over the tangent plane (normal n) at the point `touch`
/// where a sphere of the ground was first met ([`super::sweep`]).
#[inline]
#[must_use]
pub fn point_over_tangent(
    shape: &PlacedShape,
    n: &Vector3<f64>,
    touch: &Vector3<f64>,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_sphere::point_over_tangent(disc, n, touch),
        PlacedShape::Roller(roller) => roller_sphere::point_over_tangent(roller, n, touch),
        PlacedShape::Box(solid) => box_sphere::point_over_tangent(solid, n, touch),
        PlacedShape::Sphere(sphere) => sphere_sphere::point_over_tangent(sphere, n, touch),
    }
}

/// Visits the points of two moving shapes whose gap is at most `reach`, m;
/// n from the first to the second.
pub fn visit_pair(
    first: &PlacedShape,
    second: &PlacedShape,
    reach: f64,
    mut visit: impl FnMut(&PairPoint),
) {
    let (first, second) = thinned(first, second);
    match (&first, &second) {
        (PlacedShape::Box(a), PlacedShape::Box(b)) => box_box::points(a, b, reach, visit),
        (PlacedShape::Disc(a), PlacedShape::Box(b)) => disc_box::points(a, b, reach, visit),
        (PlacedShape::Box(a), PlacedShape::Disc(b)) => {
            disc_box::points(b, a, reach, |point| visit(&point.swapped()));
        }
        (first, second) => {
            let near = nearest_points(first, second);
            if near.gap <= reach {
                visit(&near);
            }
        }
    }
}

/// The point of a feature of two moving shapes, wherever it is; n from the first to the second.
#[must_use]
pub fn point_of_pair(first: &PlacedShape, second: &PlacedShape, feature: usize) -> PairPoint {
    let (first, second) = thinned(first, second);
    match (&first, &second) {
        (PlacedShape::Box(a), PlacedShape::Box(b)) => box_box::point(a, b, feature),
        (PlacedShape::Disc(a), PlacedShape::Box(b)) => disc_box::point(a, b, feature),
        (PlacedShape::Box(a), PlacedShape::Disc(b)) => disc_box::point(b, a, feature).swapped(),
        (first, second) => nearest_points(first, second),
    }
}

/// Two shapes as their pair is measured: unless the other one is a ball, a wheel with a width is
/// the disc midway along its axle.
fn thinned(first: &PlacedShape, second: &PlacedShape) -> (PlacedShape, PlacedShape) {
    let beside = |shape: &PlacedShape, other: &PlacedShape| match (shape, other) {
        (PlacedShape::Roller(_), PlacedShape::Sphere(_)) => *shape,
        (PlacedShape::Roller(roller), _) => PlacedShape::Disc(roller.middle()),
        _ => *shape,
    };
    (beside(first, second), beside(second, first))
}

/// Nearest points of two moving shapes.
#[must_use]
pub fn nearest_points(first: &PlacedShape, second: &PlacedShape) -> PairPoint {
    match (first, second) {
        (PlacedShape::Sphere(a), PlacedShape::Sphere(b)) => sphere_sphere::nearest_points(a, b),
        (PlacedShape::Disc(a), PlacedShape::Sphere(b)) => disc_sphere::nearest_points(a, b),
        (PlacedShape::Sphere(a), PlacedShape::Disc(b)) => {
            disc_sphere::nearest_points(b, a).swapped()
        }
        (PlacedShape::Roller(a), PlacedShape::Sphere(b)) => roller_sphere::nearest_points(a, b),
        (PlacedShape::Sphere(a), PlacedShape::Roller(b)) => {
            roller_sphere::nearest_points(b, a).swapped()
        }
        (PlacedShape::Box(a), PlacedShape::Sphere(b)) => box_sphere::nearest_points(a, b),
        (PlacedShape::Sphere(a), PlacedShape::Box(b)) => box_sphere::nearest_points(b, a).swapped(),
        (PlacedShape::Disc(a), PlacedShape::Disc(b)) => disc_disc::nearest_points(a, b),
        _ => convex::nearest_points(first, second),
    }
}
