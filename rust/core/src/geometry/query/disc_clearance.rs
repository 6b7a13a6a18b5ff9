//! How far a disc may move before it can touch a piece of a surface.
//!
//! The bounds are cheap and need not be sharp: they say which of the pieces around a wheel can be
//! left out for some steps.

use nalgebra::Vector3;

use super::NEAREST;
use super::disc_plane::rim_point_over;
use super::disc_sphere;
use crate::geometry::terrain::surface::{Edge, Face, Vertex};
use crate::geometry::{Disc, Primitive, Sphere};

/// What turning the axle by an angle moves, in wheel radii, while |n × s| is at least `UPRIGHT`:
/// the lowest rim point over n moves by the radius times the turn of the unit vector of
/// n − s (n · s), which changes by at most 2 |δs| and whose direction thus by 4 |δs| / UPRIGHT.
pub const TURNING: f64 = 8.0;

/// Sine of the angle between axle and normal below which a bound by the lowest point does not hold.
const UPRIGHT: f64 = 0.5;

/// A distance (m) that the disc may move before it has a point on the piece closer than the same
/// distance; a turn of the axle by δs counts as a motion of [`TURNING`] R |δs|. `base` as in
/// [`super::dispatch`].
#[must_use]
pub fn clearance(disc: &Disc, piece: &Primitive, base: &Vector3<f64>) -> f64 {
    match piece {
        Primitive::Face(face) => over_face(disc, face, base),
        Primitive::Edge(edge) => at_edge(disc, edge, base),
        Primitive::Vertex(vertex) => at_vertex(disc, vertex, base),
        Primitive::Plane(_) | Primitive::Sphere(_) => f64::NEG_INFINITY,
    }
}

fn is_upright(disc: &Disc, n: &Vector3<f64>) -> bool {
    n.cross(&disc.axle).norm_squared() >= UPRIGHT * UPRIGHT
}

/// The lowest point must come to the plane and to where the face has it, or the other two rim
/// points to the plane.
fn over_face(disc: &Disc, face: &Face, base: &Vector3<f64>) -> f64 {
    let n = face.plane.normal();
    if !is_upright(disc, n) {
        return f64::NEG_INFINITY;
    }
    let on_plane = -base - n * face.plane.offset();
    let low = rim_point_over(disc, n, &on_plane, NEAREST);
    let place = base + low.point;
    let beyond = face.walls.iter().map(|wall| wall.beyond(&place));
    let others = low.gap + 1.5 * disc.radius * n.cross(&disc.axle).norm();
    beyond.fold(low.gap, f64::max).min(others)
}

/// The lowest points over both faces must come to the planes, on the edge's side of their faces,
/// and one between them to the edge's length.
fn at_edge(disc: &Disc, edge: &Edge, base: &Vector3<f64>) -> f64 {
    let [first, second] = &edge.normals;
    if edge.is_sharp() || !is_upright(disc, first) || !is_upright(disc, second) {
        return f64::NEG_INFINITY;
    }
    let start = edge.start - base;
    let lows = [first, second].map(|n| rim_point_over(disc, n, &start, NEAREST));
    let [one, two] = lows.map(|low| low.point - start);
    let gap = lows[0].gap.max(lows[1].gap);
    let sideways = edge.lean(first, &one).max(-edge.lean(second, &two));
    // Each place and their distance may change by as much as the disc moves.
    let (a, b) = (one.dot(&edge.along), two.dot(&edge.along));
    let spread = (one - two).norm() + (-lows[0].gap.min(lows[1].gap)).max(0.0);
    let along = (a.min(b) - edge.length).max(-a.max(b)) - spread;
    gap.max(sideways).max(along / 3.0)
}

/// The rim must come to the vertex; or the vertex abreast of the face, with an axle along which it
/// may push.
fn at_vertex(disc: &Disc, vertex: &Vertex, base: &Vector3<f64>) -> f64 {
    let point = Sphere {
        centre: vertex.place,
        radius: 0.0,
    };
    let near = disc_sphere::nearest_point(disc, &point, base);
    let offset = vertex.place - base - disc.centre;
    let beside = (offset - disc.axle * offset.dot(&disc.axle)).norm() - disc.radius;
    let pierces = [disc.axle, -disc.axle].map(|n| {
        let turn = vertex.steepest(&n).max(0.0);
        beside.max(TURNING * disc.radius * turn)
    });
    near.gap.min(pierces[0]).min(pierces[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::dispatch;
    use crate::geometry::{HeightField, PlacedShape, Terrain};
    use proptest::prelude::*;

    fn disc(place: [f64; 3], heading: f64, lean: f64) -> Disc {
        let level = Vector3::new(heading.sin(), 0.0, heading.cos());
        let axle = (level * lean.cos() + Vector3::y() * lean.sin()).normalize();
        Disc {
            centre: Vector3::from(place),
            axle,
            spoke: axle.cross(&Vector3::y()).normalize(),
            radius: 0.15,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        /// A disc that has moved by less than its clearance and a reach has no point within reach.
        #[test]
        fn no_piece_is_touched_that_was_left_out(
            heights in prop::collection::vec(-0.04_f32..0.04, 25),
            place in [-0.05..0.05, 0.08..0.2, -0.05..0.05_f64],
            (heading, lean) in (0.0..std::f64::consts::TAU, -0.6..0.6),
            shift in prop::array::uniform3(-0.02..0.02_f64),
            turn in prop::array::uniform2(-0.01..0.01_f64),
            reach in 0.0..0.01,
        ) {
            let field = HeightField::new(heights, [5, 5], [0.05; 2], [-0.1; 2]).unwrap();
            let before = disc(place, heading, lean);
            let place = std::array::from_fn(|k| place[k] + shift[k]);
            let after = disc(place, heading + turn[0], lean + turn[1]);
            let turn = (after.axle - before.axle).norm() * after.radius * TURNING;
            let moved = (after.centre - before.centre).norm() + turn;
            let base = Vector3::zeros();
            let shape = PlacedShape::Disc(after);
            let gap_at = |piece: &Primitive| {
                let mut found = None;
                let mut visit = |point: &crate::geometry::query::SurfacePoint| {
                    found = Some(point.gap);
                };
                match piece {
                    Primitive::Face(face) => {
                        dispatch::visit_on_face(&shape, face, &base, reach, visit);
                    }
                    Primitive::Edge(edge) => {
                        dispatch::visit_at_edge(&shape, edge, &base, reach, visit);
                    }
                    Primitive::Vertex(vertex) => {
                        let near = dispatch::point_at_vertex(&shape, vertex, &base);
                        if near.gap <= reach && vertex.admits(&near.n) {
                            visit(&near);
                        }
                    }
                    _ => {}
                }
                found
            };
            let mut left_out = Ok(());
            field.visit_near(&after.centre, 1.0, &mut |id, piece| {
                let may_be = clearance(&before, piece, &base) <= moved + reach;
                if let (false, Some(gap)) = (may_be, gap_at(piece)) {
                    left_out = Err((id, gap));
                }
            });
            prop_assert_eq!(left_out, Ok(()));
        }
    }
}
