//! Disc on a triangulated surface.
//!
//! Against a face the disc's points are those over a plane ([`super::disc_plane`]) that lie over
//! the face. Against a convex edge with the start a and the unit direction e the contact normal is
//! the one between the faces' that separates most, `max n · (E(n) − a)` with the lowest rim point
//! E(n) over the plane of normal n. There the rim point lies over the edge:
//! `(n × e) · (E(n) − a) = 0`,
//! found by a safeguarded secant iteration on `n ∝ (1 − τ) n₁ + τ n₂`. If the lowest point for a
//! face's own normal is over that face, the face touches and the edge does not, so contacts hand
//! over from face to edge with gap, point and normal continuous. A vertex is a ball of radius
//! zero.
//!
//! Each gap is a maximum over normals, so its gradient is nᵀ times the Jacobian of the material
//! point (envelope theorem).

use nalgebra::Vector3;

use super::disc_plane::{rim_point_over, rim_points};
use super::{NEAREST, SurfacePoint, disc_sphere};
use crate::geometry::terrain::surface::{Edge, Face, OVERLAP, Vertex};
use crate::geometry::{Disc, Sphere};

/// Most iterations for the normal at an edge: bisection alone reaches rounding with 55.
const MAX_ITERATIONS: usize = 60;

/// Rim points over a face whose gap is at most `reach`; `base` as in [`super::dispatch`].
#[inline]
pub fn rim_points_over_face(
    disc: &Disc,
    face: &Face,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    rim_points(disc, &face.plane, base, reach, |point| {
        if face.admits(&(base + point.point)) {
            visit(point);
        }
    });
}

/// The rim point over an edge, if its normal lies strictly between the faces'.
#[inline]
#[must_use]
pub fn rim_point_at_edge(disc: &Disc, edge: &Edge, base: &Vector3<f64>) -> Option<SurfacePoint> {
    let point = rim_point_between(disc, edge, base)?;
    let place = (point.point - (edge.start - base)).dot(&edge.along);
    edge.has(place, -point.gap).then_some(point)
}

/// The same anywhere along the edge's line.
#[inline]
#[must_use]
pub(super) fn rim_point_between(
    disc: &Disc,
    edge: &Edge,
    base: &Vector3<f64>,
) -> Option<SurfacePoint> {
    let start = edge.start - base;
    let Slope { low, high } = Slope::at_ends(disc, edge, &start);
    let is_between = low < OVERLAP && high > -OVERLAP;
    is_between.then(|| between(disc, edge, &start, low, high))
}

/// The rim point that an edge pushes, with the admissible normal that separates most.
#[inline]
#[must_use]
pub fn nearest_at_edge(disc: &Disc, edge: &Edge, base: &Vector3<f64>) -> SurfacePoint {
    let start = edge.start - base;
    let Slope { low, high } = Slope::at_ends(disc, edge, &start);
    between(disc, edge, &start, low, high)
}

#[inline]
fn between(disc: &Disc, edge: &Edge, start: &Vector3<f64>, low: f64, high: f64) -> SurfacePoint {
    let [first, second] = &edge.normals;
    if low >= 0.0 {
        rim_point_over(disc, first, start, NEAREST)
    } else if high <= 0.0 {
        rim_point_over(disc, second, start, NEAREST)
    } else {
        over_edge(disc, edge, start, low, high)
    }
}

/// The rim point that a vertex pushes, wherever it is.
#[inline]
#[must_use]
pub fn nearest_at_vertex(disc: &Disc, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let point = Sphere {
        centre: vertex.place,
        radius: 0.0,
    };
    disc_sphere::nearest_point(disc, &point, base)
}

/// Derivative of the gap at the two ends of an edge's normals, up to a positive factor and with the
/// sign reversed.
struct Slope {
    low: f64,
    high: f64,
}

impl Slope {
    #[inline]
    fn at_ends(disc: &Disc, edge: &Edge, start: &Vector3<f64>) -> Self {
        let [low, high] = edge.normals.map(|n| slope(disc, edge, start, &n).0);
        Self { low, high }
    }
}

#[inline]
fn slope(disc: &Disc, edge: &Edge, start: &Vector3<f64>, n: &Vector3<f64>) -> (f64, SurfacePoint) {
    let point = rim_point_over(disc, n, start, NEAREST);
    (edge.lean(n, &(point.point - start)), point)
}

/// The rim point over an edge, between normals where the slope is below and above zero.
fn over_edge(disc: &Disc, edge: &Edge, start: &Vector3<f64>, low: f64, high: f64) -> SurfacePoint {
    let [first, second] = &edge.normals;
    let (mut a, mut fa, mut b, mut fb) = (0.0, low, 1.0, high);
    let mut point = rim_point_over(disc, first, start, NEAREST);
    for k in 0..MAX_ITERATIONS {
        // Illinois' rule keeps both ends moving; every third step halves.
        let secant = (a * fb - b * fa) / (fb - fa);
        let tau = if k % 3 == 2 || !(secant > a && secant < b) {
            0.5 * (a + b)
        } else {
            secant
        };
        let n = (first * (1.0 - tau) + second * tau).normalize();
        let (f, at) = slope(disc, edge, start, &n);
        point = at;
        if f.abs() <= 1e-15 * disc.radius || b - a <= f64::EPSILON || !(tau > a && tau < b) {
            break;
        }
        if f < 0.0 {
            (a, fa) = (tau, f);
            fb *= 0.5;
        } else {
            (b, fb) = (tau, f);
            fa *= 0.5;
        }
    }
    point
}
