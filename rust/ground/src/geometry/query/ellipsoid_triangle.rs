//! Ellipsoid on a triangulated surface.
//!
//! Over a face it touches with its lowest point, if that is over the face. At a convex edge with
//! the start a and the direction e the normal is the one between the faces' that separates most,
//! `max n · (E(n) − a)` with the lowest point E(n) over the plane of normal n: there
//! `(n × e) · (E(n) − a) = 0`, found by a safeguarded secant iteration as for a disc
//! ([`super::disc_triangle`]). A vertex is a ball of radius zero. The gap is a maximum over
//! normals, so its gradient is nᵀ times the Jacobian of the material point.

use nalgebra::Vector3;

use super::crossing::crossing;
use super::{NEAREST, SurfacePoint, ellipsoid_sphere};
use crate::geometry::terrain::surface::{Edge, OVERLAP, Vertex};
use crate::geometry::{Ellipsoid, Sphere, SupportMap};

/// The point at an edge, if its normal lies strictly between the faces'; `base` as in
/// [`super::dispatch`].
#[must_use]
pub fn point_at_edge(solid: &Ellipsoid, edge: &Edge, base: &Vector3<f64>) -> Option<SurfacePoint> {
    let start = edge.start - base;
    let [first, second] = &edge.normals;
    let is_between =
        lean(solid, edge, &start, first) < OVERLAP && lean(solid, edge, &start, second) > -OVERLAP;
    let point = is_between.then(|| nearest_at_edge(solid, edge, base))?;
    let place = (point.point - start).dot(&edge.along);
    edge.has(place, -point.gap).then_some(point)
}

/// The point that an edge's line pushes, with the admissible normal that separates most.
#[must_use]
pub fn nearest_at_edge(solid: &Ellipsoid, edge: &Edge, base: &Vector3<f64>) -> SurfacePoint {
    let start = edge.start - base;
    let [first, second] = &edge.normals;
    let (low, high) = (
        lean(solid, edge, &start, first),
        lean(solid, edge, &start, second),
    );
    let n = if low >= 0.0 {
        *first
    } else if high <= 0.0 {
        *second
    } else {
        // Where the lean vanishes.
        let at = |tau: f64| (first * (1.0 - tau) + second * tau).normalize();
        let near = 2e-15 * solid.bound();
        at(crossing([low, high], |tau| {
            (lean(solid, edge, &start, &at(tau)), near)
        }))
    };
    let point = solid.support(&-n);
    SurfacePoint::of_normal(NEAREST, point, &n, n.dot(&(point - start)))
}

/// Derivative of the gap along the edge's normals, with the sign reversed.
fn lean(solid: &Ellipsoid, edge: &Edge, start: &Vector3<f64>, n: &Vector3<f64>) -> f64 {
    edge.lean(n, &(solid.support(&-n) - start))
}

/// The point nearest to a vertex, wherever it is.
#[must_use]
pub fn nearest_at_vertex(solid: &Ellipsoid, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let point = Sphere::new(vertex.place, 0.0);
    ellipsoid_sphere::nearest_point(solid, &point, base)
}
