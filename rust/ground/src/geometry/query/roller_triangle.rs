//! Wheel with a width on a triangulated surface.
//!
//! Over a face its points are those over a plane ([`super::roller_plane`]) that lie over the face.
//! At a convex edge each circle touches like a disc's rim ([`super::disc_triangle`]), lowered along
//! the normal by the rounding; the ends of a capsule are balls. Where the edge crosses the tread
//! between the circles, it touches there too, also if the tread lies flat on one of the faces: the
//! normal is `n ∝ s × e`, of axle and edge, and the gap `n · (c − a) − R` with a point a of the
//! edge. A vertex is a ball of radius zero; one inside the wheel leaves it through the side that
//! the surface lets it, the tread or a side face.
//!
//! Features at an edge are those of [`super::roller_plane`], and [`TREAD`].

use nalgebra::Vector3;

use super::CIRCLE;
use super::roller_plane::swept;
use super::roller_sphere::{nearest_open, nearest_to};
use super::{SurfacePoint, disc_triangle, sphere_triangle};
use crate::geometry::terrain::surface::{Edge, Vertex};
use crate::geometry::{Roller, Sphere};

/// Feature of the tread at an edge.
pub const TREAD: usize = 2 * CIRCLE;

/// Sine of the angle between axle and edge below which they have no common normal.
const PARALLEL: f64 = 1e-9;

/// Fraction of the wheel's size by which a point may lie beyond the ends of edge and tread.
const ENDS: f64 = 1e-9;

/// Visits the points at an edge whose gap is at most `reach`; `base` as in [`super::dispatch`].
pub fn points_at_edge(
    roller: &Roller,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let slack = ENDS * (roller.core.radius + roller.half);
    let is_on = |point: &SurfacePoint| {
        let place = (point.point - (edge.start - base)).dot(&edge.along);
        point.gap <= reach && edge.has_within(place, -point.gap, slack)
    };
    for k in 0..roller.n_circles() {
        let point = if roller.core.radius > 0.0 {
            // Of two circles that one may lie on the edge whose side faces it.
            let outward = roller.core.axle * if k == 0 { 1.0 } else { -1.0 };
            let down = (roller.half > 0.0).then_some(outward);
            let mut offer = |end: &SurfacePoint| {
                let end = swept(roller, k, *end);
                if is_on(&end) {
                    visit(&end);
                }
            };
            if disc_triangle::visit_chord(&roller.circle(k), edge, base, down, &mut offer) {
                continue;
            }
            let point = disc_triangle::rim_point_between(&roller.circle(k), edge, base);
            point.map(|point| swept(roller, k, point))
        } else {
            let end = sphere_triangle::point_at_edge(&end_of_capsule(roller, k), edge, base);
            end.map(|point| of_end(k, point))
        };
        if let Some(point) = point.filter(is_on) {
            visit(&point);
        }
    }
    if let Some((point, own)) = on_tread(roller, edge, base)
        && own.abs() < roller.half + slack
        && edge.bears(&point.n)
        && is_on(&point)
    {
        visit(&point);
    }
}

/// The point of a feature at an edge, wherever it is.
#[must_use]
pub fn point_at_edge(
    roller: &Roller,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    let tread = || on_tread(roller, edge, base).filter(|_| feature == TREAD);
    tread().map_or_else(
        || {
            let k = feature / CIRCLE % 2;
            if roller.core.radius <= 0.0 {
                let end = end_of_capsule(roller, k);
                return of_end(k, sphere_triangle::nearest_at_edge(&end, edge, base));
            }
            let circle = roller.circle(k);
            swept(
                roller,
                k,
                disc_triangle::point_at_edge(&circle, edge, base, feature % CIRCLE),
            )
        },
        |(point, _)| point,
    )
}

/// The ball at an end of a capsule.
fn end_of_capsule(roller: &Roller, k: usize) -> Sphere {
    Sphere::new(roller.circle(k).centre, roller.rounding)
}

fn of_end(k: usize, point: SurfacePoint) -> SurfacePoint {
    SurfacePoint {
        feature: CIRCLE * k,
        ..point
    }
}

/// The point where an edge crosses the tread, held between the circles, and its place along the
/// axle from the middle before that, m.
fn on_tread(roller: &Roller, edge: &Edge, base: &Vector3<f64>) -> Option<(SurfacePoint, f64)> {
    let (s, e) = (&roller.core.axle, &edge.along);
    let across = s.cross(e);
    let sine = across.norm();
    if sine <= PARALLEL {
        return None;
    }
    let up = (edge.normals[0] + edge.normals[1]).dot(&across);
    let n = across / if up < 0.0 { -sine } else { sine };
    let low = roller.core.centre - n * roller.radius();
    let between = low - (edge.start - base);
    let gap = n.dot(&between);
    // between + own s − place e = gap n
    let rest = between - n * gap;
    let own = (s.dot(e) * rest.dot(e) - rest.dot(s)) / (sine * sine);
    let point = SurfacePoint {
        feature: TREAD,
        point: low + s * own.clamp(-roller.half, roller.half),
        n,
        rolling: roller.core.spoke,
        gap,
    };
    Some((point, own))
}

/// The point that a vertex pushes, wherever it is.
#[inline]
#[must_use]
pub fn nearest_at_vertex(roller: &Roller, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let offset = vertex.place - base - roller.core.centre;
    let near = nearest_to(roller, &offset);
    if near.gap < 0.0 && !vertex.bears(&near.n) {
        return nearest_open(roller, &offset, |n| vertex.bears(n));
    }
    near
}
