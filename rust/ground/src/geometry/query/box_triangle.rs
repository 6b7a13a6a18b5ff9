//! Box on a triangulated surface: its edges across a convex edge, its faces and edges on a convex
//! vertex. Over a face it touches with its corners, as on a plane ([`super::box_plane`]).
//!
//! Of the box's twelve edges those along one axis share the normal `n ∝ e × f` with an edge of the
//! surface, and the side of n decides which of the four can touch: one, or both of a side of the
//! box that lies flat on the edge. A corner that has not yet come down to an edge is met too. The
//! feature at an edge is the number of the box's edge ([`OrientedBox::edge`]), or 12 and the
//! corner's number.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint, box_sphere};
use crate::geometry::OrientedBox;
use crate::geometry::shape::oriented_box::signs;
use crate::geometry::terrain::surface::{Edge, Vertex};

/// Sine of the angle between two edges below which they have no common normal.
const PARALLEL: f64 = 1e-9;

/// Sine of the angle by which a normal may leave the normals of an edge of the box: a side that
/// lies flat on an edge of the surface rests on two of its own.
const SLACK: f64 = 0.02;

/// Fraction of the box's size by which a crossing may lie beyond the ends of the edges.
const ENDS: f64 = 1e-9;

/// Visits the crossings of the box's edges with an edge of the surface whose gap is at most
/// `reach`; `base` as in [`super::dispatch`].
pub fn crossings(
    solid: &OrientedBox,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let slack = ENDS * solid.half_size.max();
    for axis in 0..3 {
        let Some((n, sine)) = normal(solid, edge, axis).filter(|(n, _)| edge.bears(n)) else {
            continue;
        };
        let local = solid.R.tr_mul(&n);
        let touches = |k: usize, side: f64| local[k] * side <= SLACK;
        for number in 4 * axis..4 * axis + 4 {
            let side = signs(number % 4);
            if touches((axis + 1) % 3, side[0]) && touches((axis + 2) % 3, side[1]) {
                let (point, place, own) = crossing(solid, edge, base, number, (&n, sine));
                let is_between = own.abs() <= solid.half_size[axis] + slack;
                if is_between && point.gap <= reach && edge.has_within(place, -point.gap, slack) {
                    visit(&point);
                }
            }
        }
    }
    for number in 0..8 {
        let from_start = solid.corner(number) - (edge.start - base);
        let place = from_start.dot(&edge.along);
        if (from_start - edge.along * place).norm_squared() > reach * reach {
            continue;
        }
        let (point, place) = corner_over(solid, edge, base, number);
        let supports = solid.R.tr_mul(&point.n).dot(&signs(number)) < 0.0
            && (0..3).all(|k| solid.axis(k).dot(&point.n) * signs(number)[k] <= 0.0);
        if point.gap > 0.0
            && point.gap <= reach
            && supports
            && edge.admits(&point.n)
            && edge.has(place, 0.0)
        {
            visit(&point);
        }
    }
}

/// A corner over the line of an edge, and its place along it, m.
fn corner_over(
    solid: &OrientedBox,
    edge: &Edge,
    base: &Vector3<f64>,
    number: usize,
) -> (SurfacePoint, f64) {
    let corner = solid.corner(number);
    let from_start = corner - (edge.start - base);
    let place = from_start.dot(&edge.along);
    let across = from_start - edge.along * place;
    let gap = across.norm();
    let up = (edge.normals[0] + edge.normals[1]).normalize();
    let n = across
        .try_normalize(0.0)
        .filter(|n| n.dot(&up) > 0.0)
        .unwrap_or(up);
    let gap = gap.copysign(n.dot(&across));
    (
        SurfacePoint::of_normal(CORNERS + number, corner, &n, gap),
        place,
    )
}

/// Feature of the first corner.
const CORNERS: usize = 12;

/// The point of a feature, wherever it is; the box's lowest corner if the edges are parallel.
#[must_use]
pub fn point_at_edge(
    solid: &OrientedBox,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    if feature >= CORNERS {
        return corner_over(solid, edge, base, feature - CORNERS).0;
    }
    normal(solid, edge, feature / 4).map_or_else(
        || {
            let n = (edge.normals[0] + edge.normals[1]).normalize();
            let point = crate::geometry::SupportMap::support(solid, &-n);
            let gap = n.dot(&(point - (edge.start - base)));
            SurfacePoint::of_normal(feature, point, &n, gap)
        },
        |(n, sine)| crossing(solid, edge, base, feature, (&n, sine)).0,
    )
}

/// The common normal of an edge of the surface and the box's edges along an axis, out of the
/// ground, and the sine of their angle.
#[inline]
fn normal(solid: &OrientedBox, edge: &Edge, axis: usize) -> Option<(Vector3<f64>, f64)> {
    let across = edge.along.cross(&solid.axis(axis));
    let sine = across.norm();
    if sine <= PARALLEL {
        return None;
    }
    let up = (edge.normals[0] + edge.normals[1]).dot(&across);
    Some((across / if up < 0.0 { -sine } else { sine }, sine))
}

/// The crossing with one of the box's edges along their common normal, its place along the edge of
/// the surface (m from the start) and along the box's (m from the middle).
fn crossing(
    solid: &OrientedBox,
    edge: &Edge,
    base: &Vector3<f64>,
    number: usize,
    (n, sine): (&Vector3<f64>, f64),
) -> (SurfacePoint, f64, f64) {
    let (middle, f, _) = solid.edge(number);
    let between = middle - (edge.start - base);
    let gap = n.dot(&between);
    // between + s f − t e = gap n
    let rest = between - n * gap;
    let (along, own, c) = (rest.dot(&edge.along), rest.dot(&f), edge.along.dot(&f));
    let s = (c * along - own) / (sine * sine);
    let place = along + s * c;
    let point = SurfacePoint::of_normal(number, middle + f * s, n, gap);
    (point, place, s)
}

/// The point that a vertex pushes, wherever it is: for one that is inside, of the nearest of the
/// sides through which the surface lets it.
#[inline]
#[must_use]
pub fn nearest_at_vertex(
    solid: &OrientedBox,
    vertex: &Vertex,
    base: &Vector3<f64>,
) -> SurfacePoint {
    let local = solid.R.tr_mul(&(vertex.place - base - solid.centre));
    let (mut point, mut n, mut distance) = box_sphere::nearest_local(&local, &solid.half_size);
    let admits = |n: &Vector3<f64>| vertex.bears(&(solid.R * n));
    if distance < 0.0 && !admits(&n) {
        let through = |k, side| box_sphere::through_side(&local, &solid.half_size, k, side);
        let sides = (0..3).flat_map(|k| [through(k, 1.0), through(k, -1.0)]);
        let open = sides.filter(|(_, n, _)| admits(n));
        if let Some(side) = open.max_by(|a, b| a.2.total_cmp(&b.2)) {
            (point, n, distance) = side;
        }
    }
    let point = solid.centre + solid.R * point;
    SurfacePoint::of_normal(NEAREST, point, &(solid.R * n), distance)
}
