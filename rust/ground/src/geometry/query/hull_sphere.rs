//! Convex polytope on a sphere: the point of the polytope nearest to the sphere's centre.
//!
//! Let F be the face whose plane is furthest out at a place. A place that is in the polytope is
//! nearest to F. For one outside, the nearest point lies on F if it lies on a face at all: for any
//! other face G the distance from its plane is at most that from F times the cosine between their
//! normals. Otherwise it lies on an edge. `gap = ±distance − r_s`; the nearest point minimises over
//! the polytope, so the gap's gradient is nᵀ times the Jacobian of the material point.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint};
use crate::geometry::{Hull, Sphere, SupportMap};
use crate::spatial::{Polytope, PolytopeFace};

/// Cosine of the tilt of a plane against a face below which it touches a vertex and not the face:
/// more than a part turns in a step.
const TILTED: f64 = 0.995;

/// Nearest point of the surface, unit normal into the polytope and signed distance of a place, all
/// in the polytope's coordinates.
#[must_use]
pub fn nearest_local(polytope: &Polytope, x: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>, f64) {
    let hull = Hull {
        centre: Vector3::zeros(),
        R: nalgebra::Matrix3::identity(),
        polytope,
    };
    let (k, distance) = hull.outermost(x);
    let face = &polytope.faces()[k];
    let (foot, n, distance) = through_face(face, x, distance);
    if distance <= 0.0 || is_over(polytope, face, &foot, 0.0) {
        return (foot, n, distance);
    }
    let mut best = (foot, f64::INFINITY);
    for edge in polytope.edges() {
        let [p, q] = edge.ends.map(|k| polytope.vertices()[k]);
        let along = q - p;
        let share = (x - p).dot(&along) / along.norm_squared();
        let point = p + along * share.clamp(0.0, 1.0);
        let square = (x - point).norm_squared();
        if square < best.1 {
            best = (point, square);
        }
    }
    let (point, square) = best;
    let distance = square.sqrt();
    let inward = (point - x).try_normalize(0.0).unwrap_or(n);
    (point, inward, distance)
}

/// Nearest point of a face's plane, unit normal into the polytope and signed distance of a place x,
/// which is `distance` (m) over the plane, all in the polytope's coordinates.
#[must_use]
pub fn through_face(
    face: &PolytopeFace,
    x: &Vector3<f64>,
    distance: f64,
) -> (Vector3<f64>, Vector3<f64>, f64) {
    (x - face.normal * distance, -face.normal, distance)
}

/// Whether a place in a face's plane, or over it, is within its outline, or outside by at most
/// `slack`, m.
#[must_use]
pub fn is_over(polytope: &Polytope, face: &PolytopeFace, x: &Vector3<f64>, slack: f64) -> bool {
    let n = face.corners.len();
    (0..n).all(|k| {
        let [p, q] = [k, (k + 1) % n].map(|k| polytope.vertices()[face.corners[k]]);
        let along = q - p;
        along.cross(&(x - p)).dot(&face.normal) >= -slack * along.norm()
    })
}

/// Nearest point of a hull; `base` (m, world) is where its coordinates have their origin.
#[must_use]
pub fn nearest_point(hull: &Hull<'_>, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let local = hull.local(&(sphere.centre - base));
    let (point, n, distance) = nearest_local(hull.polytope, &local);
    let point = hull.place(&point);
    SurfacePoint::of_normal(NEAREST, point, &(hull.R * n), distance - sphere.radius)
}

/// The hull's point over the tangent plane (normal n) at the point `touch` where a sphere was first
/// met: its lowest vertex, or the place over `touch` of a face that lies along the plane.
#[must_use]
pub fn point_over_tangent(hull: &Hull<'_>, n: &Vector3<f64>, touch: &Vector3<f64>) -> SurfacePoint {
    let down = -hull.R.tr_mul(n);
    let faces = hull.polytope.faces().iter();
    let lowest = faces.max_by(|a, b| a.normal.dot(&down).total_cmp(&b.normal.dot(&down)));
    let flat = lowest.filter(|face| face.normal.dot(&down) > TILTED);
    let point = flat.map_or_else(
        || hull.support(&-n),
        |face| {
            let local = hull.local(touch);
            let rise = (face.offset - face.normal.dot(&local)) / face.normal.dot(&down);
            hull.place(&(local + down * rise))
        },
    );
    SurfacePoint::of_normal(NEAREST, point, n, n.dot(&(point - touch)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        #[test]
        fn no_point_of_the_polytope_is_nearer(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 6..20),
            x in prop::array::uniform3(-1.5..1.5), weights in prop::collection::vec(0.0..1.0_f64, 20),
        ) {
            let points: Vec<_> = points.into_iter().map(Vector3::from).collect();
            let Some(polytope) = Polytope::hull_of(&points) else { return Ok(()) };
            let x = Vector3::from(x);
            let (q, n, distance) = nearest_local(&polytope, &x);
            prop_assert!((q - x - n * distance).norm() < 1e-12);
            // The polytope lies beyond the plane through q across n.
            for vertex in polytope.vertices() {
                prop_assert!(n.dot(&(vertex - q)) > -1e-5, "{distance}");
            }
            let inside = polytope.faces().iter().all(|f| f.normal.dot(&q) - f.offset < 1e-5);
            prop_assert!(inside, "the nearest point is in the polytope");
            let sum: f64 = weights.iter().take(polytope.vertices().len()).sum();
            let within: Vector3<f64> = polytope.vertices().iter().zip(&weights).map(|(v, w)| v * *w).sum::<Vector3<f64>>() / sum;
            if distance > 0.0 {
                prop_assert!(distance <= (within - x).norm() + 1e-9);
            }
        }
    }
}
