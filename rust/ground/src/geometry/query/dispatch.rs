//! Chooses the module that measures a shape against the ground, and the nearest points of two
//! shapes. No other place but [`super::pairs`] knows all pairs.
//!
//! A new shape adds its arms here; see "add a shape" in `CONTRIBUTING.md`.

use nalgebra::Vector3;

use super::{
    NEAREST, PairPoint, SurfacePoint, box_plane, box_sphere, box_triangle, convex, disc_disc,
    disc_plane, disc_triangle, ellipsoid_plane, ellipsoid_sphere, ellipsoid_triangle, hull_plane,
    hull_sphere, hull_triangle, is_lowest, roller_plane, roller_sphere, roller_triangle,
    sphere_plane, sphere_sphere, sphere_triangle,
};
use crate::geometry::terrain::surface::{Edge, Face, Vertex};
use crate::geometry::{PlacedShape, Plane, Roller, Sphere};

/// Visits the points of a shape over a plane of the ground whose gap is at most `reach`, m.
///
/// `base` (m, world) is where the shape's coordinates have their origin, here and below.
#[inline]
pub fn visit_on_plane(
    shape: &PlacedShape<'_>,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    match shape {
        PlacedShape::Disc(disc) => disc_plane::rim_points(disc, plane, base, reach, visit),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_plane::rim_points(roller, plane, base, reach, visit);
        }
        PlacedShape::Box(solid) => box_plane::corners(solid, plane, base, reach, visit),
        PlacedShape::Sphere(sphere) => {
            let low = sphere_plane::lowest_point(sphere, plane, base);
            if low.gap <= reach {
                visit(&low);
            }
        }
        PlacedShape::Ellipsoid(solid) => {
            let low = ellipsoid_plane::lowest_point(solid, plane, base);
            if low.gap <= reach {
                visit(&low);
            }
        }
        PlacedShape::Hull(hull) => hull_plane::vertices(hull, plane, base, reach, visit),
    }
}

/// The point of a feature over a plane of the ground, wherever it is.
#[inline]
#[must_use]
pub fn point_on_plane(
    shape: &PlacedShape<'_>,
    plane: &Plane,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_plane::rim_point(disc, plane, base, feature),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_plane::rim_point(roller, plane, base, feature)
        }
        PlacedShape::Box(solid) => box_plane::corner(solid, plane, base, feature),
        PlacedShape::Sphere(sphere) => sphere_plane::lowest_point(sphere, plane, base),
        PlacedShape::Ellipsoid(solid) => ellipsoid_plane::lowest_point(solid, plane, base),
        PlacedShape::Hull(hull) => hull_plane::vertex(hull, plane, base, feature),
    }
}

/// The lowest point of a wheel over a plane of the ground.
#[inline]
#[must_use]
pub fn lowest_on_plane(
    shape: &PlacedShape<'_>,
    plane: &Plane,
    base: &Vector3<f64>,
) -> SurfacePoint {
    match shape {
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_plane::lowest_point(roller, plane, base)
        }
        PlacedShape::Hull(hull) => hull_plane::lowest_vertex(hull, plane, base),
        _ => point_on_plane(shape, plane, base, NEAREST),
    }
}

/// Nearest point of a shape to a sphere of the ground.
#[inline]
#[must_use]
pub fn point_on_sphere(
    shape: &PlacedShape<'_>,
    ground: &Sphere,
    base: &Vector3<f64>,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => roller_sphere::nearest_point(&Roller::thin(*disc), ground, base),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_sphere::nearest_point(roller, ground, base)
        }
        PlacedShape::Box(solid) => box_sphere::nearest_point(solid, ground, base),
        PlacedShape::Sphere(sphere) => sphere_sphere::nearest_point(sphere, ground, base),
        PlacedShape::Ellipsoid(solid) => ellipsoid_sphere::nearest_point(solid, ground, base),
        PlacedShape::Hull(hull) => hull_sphere::nearest_point(hull, ground, base),
    }
}

/// Visits the points of a shape over a face of a surface whose gap is at most `reach`, m: those
/// over its plane that lie over the face.
#[inline]
pub fn visit_on_face(
    shape: &PlacedShape<'_>,
    face: &Face,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let n = face.plane.normal();
    let lies = match shape {
        PlacedShape::Disc(disc) => disc_triangle::may_lie(disc, n),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            disc_triangle::may_lie(&roller.core, n)
        }
        _ => true,
    };
    visit_on_plane(shape, &face.plane, base, reach, |point| {
        if (lies || is_lowest(point.feature)) && face.admits(&(base + point.point)) {
            visit(point);
        }
    });
}

/// Visits the points of a shape at a convex edge of a surface whose gap is at most `reach`, m.
#[inline]
pub fn visit_at_edge(
    shape: &PlacedShape<'_>,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let point = match shape {
        PlacedShape::Disc(disc) => {
            disc_triangle::rim_points_at_edge(disc, edge, base, reach, visit);
            return;
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_triangle::points_at_edge(roller, edge, base, reach, visit);
            return;
        }
        PlacedShape::Box(solid) => {
            box_triangle::crossings(solid, edge, base, reach, visit);
            return;
        }
        PlacedShape::Sphere(sphere) => sphere_triangle::point_at_edge(sphere, edge, base),
        PlacedShape::Ellipsoid(solid) => ellipsoid_triangle::point_at_edge(solid, edge, base),
        PlacedShape::Hull(hull) => {
            hull_triangle::points_at_edge(hull, edge, base, reach, visit);
            return;
        }
    };
    if let Some(point) = point.filter(|point| point.gap <= reach) {
        visit(&point);
    }
}

/// The point of a feature at a convex edge of a surface, wherever it is.
#[inline]
#[must_use]
pub fn point_at_edge(
    shape: &PlacedShape<'_>,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_triangle::point_at_edge(disc, edge, base, feature),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_triangle::point_at_edge(roller, edge, base, feature)
        }
        PlacedShape::Box(solid) => box_triangle::point_at_edge(solid, edge, base, feature),
        PlacedShape::Sphere(sphere) => sphere_triangle::nearest_at_edge(sphere, edge, base),
        PlacedShape::Ellipsoid(solid) => ellipsoid_triangle::nearest_at_edge(solid, edge, base),
        PlacedShape::Hull(hull) => hull_triangle::point_at_edge(hull, edge, base, feature),
    }
}

/// Whether a convex vertex of a surface may push a shape along the normal of its point there.
///
/// A round shape is pushed by the vertex where it would not be by an edge. A flat side or a
/// straight line rests on the vertices at the ends of what it lies on, whatever the rounding.
#[inline]
#[must_use]
pub fn pushes(vertex: &Vertex, shape: &PlacedShape<'_>, n: &Vector3<f64>) -> bool {
    let is_flat = match shape {
        PlacedShape::Disc(disc) => disc.axle.dot(n).abs() > ON_SIDE,
        PlacedShape::Sphere(_) | PlacedShape::Ellipsoid(_) => false,
        PlacedShape::Roller(_)
        | PlacedShape::Cylinder(_)
        | PlacedShape::Box(_)
        | PlacedShape::Hull(_) => true,
    };
    if is_flat {
        vertex.bears(n)
    } else {
        vertex.admits(n)
    }
}

/// Cosine of the angle between a disc's axle and a normal that is the axle's but for rounding.
const ON_SIDE: f64 = 1.0 - 1e-12;

/// The point of a shape at a convex vertex of a surface, wherever it is.
#[inline]
#[must_use]
pub fn point_at_vertex(
    shape: &PlacedShape<'_>,
    vertex: &Vertex,
    base: &Vector3<f64>,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => disc_triangle::nearest_at_vertex(disc, vertex, base),
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_triangle::nearest_at_vertex(roller, vertex, base)
        }
        PlacedShape::Box(solid) => box_triangle::nearest_at_vertex(solid, vertex, base),
        PlacedShape::Sphere(sphere) => sphere_triangle::nearest_at_vertex(sphere, vertex, base),
        PlacedShape::Ellipsoid(solid) => ellipsoid_triangle::nearest_at_vertex(solid, vertex, base),
        PlacedShape::Hull(hull) => hull_triangle::nearest_at_vertex(hull, vertex, base),
    }
}

/// A shape's point over the tangent plane (normal n) at the point `touch`
/// where a sphere of the ground was first met ([`super::sweep`]).
#[inline]
#[must_use]
pub fn point_over_tangent(
    shape: &PlacedShape<'_>,
    n: &Vector3<f64>,
    touch: &Vector3<f64>,
) -> SurfacePoint {
    match shape {
        PlacedShape::Disc(disc) => {
            roller_sphere::point_over_tangent(&Roller::thin(*disc), n, touch)
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            roller_sphere::point_over_tangent(roller, n, touch)
        }
        PlacedShape::Box(solid) => box_sphere::point_over_tangent(solid, n, touch),
        PlacedShape::Sphere(sphere) => sphere_sphere::point_over_tangent(sphere, n, touch),
        PlacedShape::Ellipsoid(solid) => ellipsoid_sphere::point_over_tangent(solid, n, touch),
        PlacedShape::Hull(hull) => hull_sphere::point_over_tangent(hull, n, touch),
    }
}

/// Nearest points of two moving shapes.
#[must_use]
pub fn nearest_points(first: &PlacedShape<'_>, second: &PlacedShape<'_>) -> PairPoint {
    if let PlacedShape::Sphere(ball) = second {
        return nearest_to_ball(first, ball);
    }
    if let PlacedShape::Sphere(ball) = first {
        return nearest_to_ball(second, ball).swapped();
    }
    if let (PlacedShape::Disc(a), PlacedShape::Disc(b)) = (first, second) {
        return disc_disc::nearest_points(a, b);
    }
    let is_own =
        |shape: &PlacedShape<'_>| matches!(shape, PlacedShape::Disc(_) | PlacedShape::Box(_));
    if is_own(first) && is_own(second) {
        return convex::nearest_points(first, second);
    }
    // Without their rounding, shapes that touch are still apart.
    let ((a, r_a), (b, r_b)) = (core(first), core(second));
    let near = convex::refined(&a, &b);
    if r_a + r_b > 0.0 {
        let x = near.on_first() + near.n * r_a;
        return PairPoint::from_first(NEAREST, &x, &near.n, near.gap - r_a - r_b);
    }
    near
}

/// Nearest points of a shape and a ball; n from the shape to the ball.
fn nearest_to_ball(shape: &PlacedShape<'_>, ball: &Sphere) -> PairPoint {
    if let PlacedShape::Sphere(own) = shape {
        return sphere_sphere::nearest_points(own, ball);
    }
    let near = point_on_sphere(shape, ball, &Vector3::zeros());
    PairPoint::from_first(NEAREST, &near.point, &-near.n, near.gap)
}

/// A shape without its rounding, and the rounding, m.
fn core<'a>(shape: &PlacedShape<'a>) -> (PlacedShape<'a>, f64) {
    match shape {
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            let core = Roller {
                rounding: 0.0,
                ..*roller
            };
            (PlacedShape::Cylinder(core), roller.rounding)
        }
        _ => (*shape, 0.0),
    }
}
