//! Convex polytope on a triangulated surface: its edges across a convex edge, its faces, edges and
//! vertices on a convex vertex. Over a face it touches with its vertices, as on a plane
//! ([`super::hull_plane`]).
//!
//! An edge f of the polytope and an edge e of the surface touch along the normal `n ∝ e × f`, where
//! n is between the normals of the surface's faces and −n between those of the polytope's. A vertex
//! of the polytope that has not yet come down to an edge is met too. The feature at an edge is the
//! polytope's edge, or `VERTICES` and the vertex's number.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint, hull_sphere};
use crate::geometry::Hull;
use crate::geometry::terrain::surface::{Edge, Vertex};
use crate::spatial::PolytopeEdge;

/// Sine of the angle between two edges below which they have no common normal.
const PARALLEL: f64 = 1e-9;

/// Sine of the angle by which a normal may leave the normals of an edge of the polytope: one that
/// lies flat on an edge of the surface rests on two of its own.
const SLACK: f64 = 0.02;

/// Fraction of the polytope's size by which a crossing may lie beyond the ends of the edges.
const ENDS: f64 = 1e-9;

/// Feature of the first vertex at an edge.
const VERTICES: usize = 192;

/// Visits the points at an edge whose gap is at most `reach`; `base` as in [`super::dispatch`].
pub fn points_at_edge(
    hull: &Hull<'_>,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let local = Local::of(hull, edge, base);
    let slack = ENDS * hull.polytope.bound();
    for number in 0..hull.polytope.edges().len() {
        let Some(crossing) = local.crossing(number) else {
            continue;
        };
        let is_between = (-slack..=crossing.length + slack).contains(&crossing.own);
        if is_between
            && crossing.gap <= reach
            && local.supports(&crossing.n, &hull.polytope.edges()[number])
            && local.edge.bears(&crossing.n)
            && edge.has_within(crossing.place, -crossing.gap, slack)
        {
            visit(&local.point(&crossing, number));
        }
    }
    for number in 0..hull.polytope.vertices().len() {
        let own = hull.polytope.vertices()[number];
        let from_start = own - local.edge.start;
        let place = from_start.dot(&local.edge.along);
        if (from_start - local.edge.along * place).norm_squared() > reach * reach {
            continue;
        }
        let (n, gap) = local.vertex(number);
        let supports = || {
            let rises = hull.polytope.vertices().iter().map(|x| n.dot(&(x - own)));
            rises.fold(f64::INFINITY, f64::min) >= -1e-9 * hull.polytope.bound()
        };
        if gap > 0.0 && gap <= reach && local.edge.admits(&n) && edge.has(place, 0.0) && supports()
        {
            visit(&local.of_vertex(number));
        }
    }
}

/// The point of a feature, wherever it is; the hull's lowest vertex if the edges are parallel.
#[must_use]
pub fn point_at_edge(
    hull: &Hull<'_>,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    let local = Local::of(hull, edge, base);
    let last = hull.polytope.vertices().len() - 1;
    if feature >= VERTICES {
        return local.of_vertex((feature - VERTICES).min(last));
    }
    let is_known = feature < hull.polytope.edges().len();
    let crossing = is_known.then(|| local.crossing(feature)).flatten();
    if let Some(crossing) = crossing {
        return local.point(&crossing, feature);
    }
    let low = hull.polytope.furthest(&-local.up());
    let n = local.up().normalize();
    let gap = n.dot(&(hull.polytope.vertices()[low] - local.edge.start));
    SurfacePoint::of_normal(feature, hull.vertex(low), &(hull.R * n), gap)
}

/// An edge of the surface in the polytope's coordinates.
struct Local<'a> {
    hull: &'a Hull<'a>,
    edge: Edge,
}

/// Where two edges cross.
struct Crossing {
    n: Vector3<f64>,
    gap: f64,
    /// Point of the polytope, local.
    point: Vector3<f64>,
    /// Place along the edge of the surface from its start, and along the polytope's, m.
    place: f64,
    own: f64,
    /// Length of the polytope's edge, m.
    length: f64,
}

impl<'a> Local<'a> {
    fn of(hull: &'a Hull<'a>, edge: &Edge, base: &Vector3<f64>) -> Self {
        let turned = |x: &Vector3<f64>| hull.R.tr_mul(x);
        let edge = Edge {
            start: hull.local(&(edge.start - base)),
            along: turned(&edge.along),
            length: edge.length,
            normals: [turned(&edge.normals[0]), turned(&edge.normals[1])],
        };
        Self { hull, edge }
    }

    fn up(&self) -> Vector3<f64> {
        self.edge.normals[0] + self.edge.normals[1]
    }

    fn crossing(&self, number: usize) -> Option<Crossing> {
        let polytope = self.hull.polytope;
        let [p, q] = polytope.edges()[number]
            .ends
            .map(|k| polytope.vertices()[k]);
        let length = (q - p).norm();
        let (e, f) = (&self.edge.along, (q - p) / length);
        let across = e.cross(&f);
        let sine = across.norm();
        if sine <= PARALLEL {
            return None;
        }
        let up = self.up().dot(&across);
        let n = across / if up < 0.0 { -sine } else { sine };
        let between = p - self.edge.start;
        let gap = n.dot(&between);
        // between + own f − place e = gap n
        let rest = between - n * gap;
        let (along, back, c) = (rest.dot(e), rest.dot(&f), e.dot(&f));
        let own = (c * along - back) / (sine * sine);
        Some(Crossing {
            n,
            gap,
            point: p + f * own,
            place: along + own * c,
            own,
            length,
        })
    }

    /// Whether the polytope lies beyond one of its edges along n, or almost.
    fn supports(&self, n: &Vector3<f64>, edge: &PolytopeEdge) -> bool {
        let polytope = self.hull.polytope;
        let [p, q] = edge.ends.map(|k| polytope.vertices()[k]);
        let along = (q - p).normalize();
        // Along each of the faces away from the edge: counterclockwise in the first one.
        let [first, second] = edge.faces.map(|k| polytope.faces()[k].normal);
        let into = [first.cross(&along), along.cross(&second)];
        into.iter().all(|into| n.dot(into) >= -SLACK)
    }

    fn point(&self, crossing: &Crossing, number: usize) -> SurfacePoint {
        let (point, n) = (self.hull.place(&crossing.point), self.hull.R * crossing.n);
        SurfacePoint::of_normal(number, point, &n, crossing.gap)
    }

    /// Normal and gap of a vertex over the line of the edge.
    fn vertex(&self, number: usize) -> (Vector3<f64>, f64) {
        let from_start = self.hull.polytope.vertices()[number] - self.edge.start;
        let across = from_start - self.edge.along * from_start.dot(&self.edge.along);
        let up = self.up().normalize();
        let n = across.try_normalize(0.0).filter(|n| n.dot(&up) > 0.0);
        let n = n.unwrap_or(up);
        (n, across.norm().copysign(n.dot(&across)))
    }

    fn of_vertex(&self, number: usize) -> SurfacePoint {
        let (n, gap) = self.vertex(number);
        let (feature, point) = (VERTICES + number, self.hull.vertex(number));
        SurfacePoint::of_normal(feature, point, &(self.hull.R * n), gap)
    }
}

/// The point that a vertex pushes, wherever it is: for one that is inside, of the nearest of the
/// faces through which the surface lets it.
#[must_use]
pub fn nearest_at_vertex(hull: &Hull<'_>, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let local = hull.local(&(vertex.place - base));
    let mut near = hull_sphere::nearest_local(hull.polytope, &local);
    let admits = |n: &Vector3<f64>| vertex.bears(&(hull.R * n));
    if near.2 < 0.0 && !admits(&near.1) {
        let through = hull.polytope.faces().iter().map(|face| {
            let distance = face.normal.dot(&local) - face.offset;
            hull_sphere::through_face(face, &local, distance)
        });
        let open = through.filter(|(_, n, _)| admits(n));
        near = open.max_by(|a, b| a.2.total_cmp(&b.2)).unwrap_or(near);
    }
    let (point, n, distance) = near;
    SurfacePoint::of_normal(NEAREST, hull.place(&point), &(hull.R * n), distance)
}
