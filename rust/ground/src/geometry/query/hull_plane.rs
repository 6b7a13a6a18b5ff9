//! Convex polytope on a plane: its vertices.
//!
//! If more than [`MOST`] vertices are in reach, as under a prism of many sides, those furthest out
//! along as many directions in the plane count, and the deepest one.

use nalgebra::Vector3;

use super::{SurfacePoint, any_tangent};
use crate::geometry::{Hull, Plane};

/// Most points beside the deepest.
pub const MOST: usize = 8;

/// Visits vertices whose gap is at most `reach`.
///
/// `base` (m, world) is where the hull's coordinates have their origin. The feature is the vertex's
/// number.
pub fn vertices(
    hull: &Hull<'_>,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let n = plane.normal();
    let height = plane.distance(base) + n.dot(&hull.centre);
    if height - hull.polytope.bound() > reach {
        return;
    }
    let down = -hull.R.tr_mul(n);
    let all = hull.polytope.vertices();
    let gap = |k: usize| height - down.dot(&all[k]);
    let (mut near, mut count, mut deepest) = (0_u64, 0, 0);
    for k in 0..all.len() {
        if gap(k) <= reach {
            near |= 1 << k;
            count += 1;
            if gap(k) < gap(deepest) || near == 1 << k {
                deepest = k;
            }
        }
    }
    if count > MOST {
        near = 1 << deepest | outermost(all, near, &down);
    }
    for k in (0..all.len()).filter(|k| near >> k & 1 == 1) {
        visit(&SurfacePoint::of_normal(k, hull.vertex(k), n, gap(k)));
    }
}

/// Vertices of the set `near` (bit k for vertex k) that are furthest along eight directions across
/// `down`.
fn outermost(vertices: &[Vector3<f64>], near: u64, down: &Vector3<f64>) -> u64 {
    let along = any_tangent(down);
    let across = down.cross(&along);
    let mut kept = 0;
    for (x, z) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)] {
        let direction = along * x + across * z;
        for direction in [direction, -direction] {
            let mut best = (0, f64::NEG_INFINITY);
            for k in (0..vertices.len()).filter(|k| near >> k & 1 == 1) {
                let place = direction.dot(&vertices[k]);
                if place > best.1 {
                    best = (k, place);
                }
            }
            kept |= 1 << best.0;
        }
    }
    kept
}

/// The vertex of a number, wherever it is.
#[must_use]
pub fn vertex(hull: &Hull<'_>, plane: &Plane, base: &Vector3<f64>, feature: usize) -> SurfacePoint {
    let point = hull.vertex(feature.min(hull.polytope.vertices().len() - 1));
    let gap = plane.distance(&(base + point));
    SurfacePoint::of_normal(feature, point, plane.normal(), gap)
}

/// The lowest vertex.
#[must_use]
pub fn lowest_vertex(hull: &Hull<'_>, plane: &Plane, base: &Vector3<f64>) -> SurfacePoint {
    let low = hull.polytope.furthest(&-hull.R.tr_mul(plane.normal()));
    vertex(hull, plane, base, low)
}
