//! Sphere on a triangulated surface: its nearest point to a convex edge or vertex. Over a face it
//! touches with its lowest point, as on a plane ([`super::sphere_plane`]).

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint, sphere_sphere};
use crate::geometry::Sphere;
use crate::geometry::terrain::surface::{Edge, OVERLAP, Vertex};

/// The point nearest to an edge, if its normal lies strictly between the faces'; `base` as in
/// [`super::dispatch`].
#[inline]
#[must_use]
pub fn point_at_edge(sphere: &Sphere, edge: &Edge, base: &Vector3<f64>) -> Option<SurfacePoint> {
    let from_start = sphere.centre - (edge.start - base);
    let place = from_start.dot(&edge.along);
    let across = from_start - edge.along * place;
    let [first, second] = &edge.normals;
    if edge.lean(first, &across) >= OVERLAP || edge.lean(second, &across) <= -OVERLAP {
        return None;
    }
    let point = nearest_at_edge(sphere, edge, base);
    edge.has(place, -point.gap).then_some(point)
}

/// The point nearest to an edge's line, with the admissible normal that separates most.
#[inline]
#[must_use]
pub fn nearest_at_edge(sphere: &Sphere, edge: &Edge, base: &Vector3<f64>) -> SurfacePoint {
    let from_start = sphere.centre - (edge.start - base);
    let across = from_start - edge.along * from_start.dot(&edge.along);
    let [first, second] = &edge.normals;
    let n = if edge.lean(first, &across) >= 0.0 {
        *first
    } else if edge.lean(second, &across) <= 0.0 {
        *second
    } else {
        across.normalize()
    };
    let gap = n.dot(&across) - sphere.radius;
    SurfacePoint::of_normal(NEAREST, sphere.centre - n * sphere.radius, &n, gap)
}

/// The point nearest to a vertex, wherever it is.
#[inline]
#[must_use]
pub fn nearest_at_vertex(sphere: &Sphere, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let point = Sphere::new(vertex.place, 0.0);
    sphere_sphere::nearest_point(sphere, &point, base)
}
