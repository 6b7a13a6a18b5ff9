//! Disc on a sphere: the point of the disc nearest to the sphere's centre.
//!
//! The disc has radius R, centre c, unit axle s; the sphere has centre a
//! and radius r_s. With `b0 = a − ((a − c)·s) s`, the projection of a onto
//! the disc's plane, the nearest point E of the disc is
//!
//! ```text
//! E = c + R unit(b0 − c)   where |b0 − c| ≥ R (the rim),
//!     else b0              (the face: a rock struck from the side)
//! gap = |a − E| − r_s,     n = unit(E − a)
//! ```
//!
//! The nearest point minimises over the disc, so the gap's gradient is nᵀ times the Jacobian of
//! the *material* point at E, on the rim and on the face (envelope theorem), and E, n and the gap
//! are continuous where one turns into the other.

use nalgebra::Vector3;

use super::{NEAREST, PairPoint, SurfacePoint};
use crate::geometry::{Disc, Sphere};

/// Lengths below which a direction is not taken from a difference, m.
const NO_DIRECTION: f64 = 1e-12;

/// Nearest point of the disc to the sphere's centre; `base` is where the
/// disc's coordinates have their origin.
///
/// If a lies on the disc itself the normal is undefined. Then n lies in the disc's plane and points
/// to its centre, so that a sphere right in its way pushes the disc back and not over. If a is the
/// disc's centre, n is along the spoke.
#[inline]
#[must_use]
pub fn nearest_point(disc: &Disc, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let s = &disc.axle;
    let offset = sphere.centre - base - disc.centre;
    let across = s * offset.dot(s);
    let in_plane = offset - across;
    let distance_in_plane = in_plane.norm();
    let outward = if distance_in_plane > NO_DIRECTION {
        in_plane / distance_in_plane
    } else {
        disc.spoke
    };
    // c to E
    let reach = outward * distance_in_plane.min(disc.radius);
    let from_centre = reach - offset;
    let distance = from_centre.norm();
    let n = if distance > NO_DIRECTION {
        from_centre / distance
    } else {
        -outward
    };
    // On the face n is along the axle; t is then the rim's direction, its limit where the rim meets
    // the face.
    SurfacePoint {
        feature: NEAREST,
        point: disc.centre + reach,
        n,
        rolling: s.cross(&outward),
        gap: distance - sphere.radius,
    }
}

/// Nearest points of a disc and a ball that moves; n from the disc to the ball.
#[must_use]
pub fn nearest_points(disc: &Disc, sphere: &Sphere) -> PairPoint {
    let near = nearest_point(disc, sphere, &Vector3::zeros());
    PairPoint::from_first(NEAREST, &near.point, &-near.n, near.gap)
}

/// Nearest point of the disc to the tangent plane (normal n) at the point
/// `touch` where a sphere was first met.
///
/// For a disc that may already be past the sphere; `touch` in the axes of `base`. The result is the
/// rim point deepest below the plane or, if the face touched first, the disc's point over `touch`.
#[inline]
#[must_use]
pub fn point_over_tangent(disc: &Disc, n: &Vector3<f64>, touch: &Vector3<f64>) -> SurfacePoint {
    let s = &disc.axle;
    let w = n - s * n.dot(s);
    let length = w.norm();
    let offset = touch - disc.centre;
    let in_plane = offset - s * offset.dot(s);
    let reach = if length > FLAT {
        w * (-disc.radius / length)
    } else {
        in_plane * (disc.radius / in_plane.norm().max(disc.radius))
    };
    SurfacePoint {
        feature: NEAREST,
        point: disc.centre + reach,
        n: *n,
        rolling: disc.spoke,
        gap: n.dot(&(reach - offset)),
    }
}

/// Sine of the angle between axle and normal below which the face of a disc, and not its rim,
/// touches. A wheel turns by less in a step that is long enough to pass a sphere.
const FLAT: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(a: f64, b: f64) -> Vector3<f64> {
        Vector3::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos())
    }

    fn wheel(a: f64, b: f64) -> Disc {
        let axle = unit(a, b);
        Disc {
            centre: Vector3::new(0.3, 0.1, -0.2),
            axle,
            spoke: crate::geometry::query::any_tangent(&axle),
            radius: 0.3,
        }
    }

    proptest! {
        #[test]
        fn no_point_of_the_disc_is_nearer(
            a in -3.0..3.0, b in -1.5..1.5,
            place in prop::array::uniform3(-0.6..0.6), phi in 0.0..std::f64::consts::TAU, share in 0.0..1.0,
        ) {
            let wheel = wheel(a, b);
            let base = Vector3::new(1.0, 2.0, 3.0);
            let sphere = Sphere { centre: base + wheel.centre + Vector3::from(place), radius: 0.05 };
            let near = nearest_point(&wheel, &sphere, &base);
            let E = near.point - wheel.centre;
            prop_assert!(E.norm() <= wheel.radius + 1e-12 && E.dot(&wheel.axle).abs() < 1e-12);
            prop_assert!((sphere.distance(&(base + near.point)) - near.gap).abs() < 1e-12);
            let outward = near.point + base - sphere.centre;
            prop_assert!((outward - near.n * (near.gap + sphere.radius)).norm() < 1e-12);
            let side = wheel.axle.cross(&wheel.spoke);
            let other = (wheel.spoke * f64::cos(phi) + side * f64::sin(phi)) * (wheel.radius * share);
            prop_assert!(near.gap <= sphere.distance(&(base + wheel.centre + other)) + 1e-12);
        }
    }

    #[test]
    fn degenerate_positions_have_normals() {
        let wheel = wheel(0.3, 0.2);
        let rim = wheel.spoke * wheel.radius;
        let places = [
            Vector3::zeros(),     // a = b0 = c
            wheel.axle * 0.1,     // b0 = c
            wheel.axle * -1e-300, // b0 = c, barely beside
            rim * 0.5,            // E = a on the face
            rim,                  // E = a on the rim
            rim * 0.5 + wheel.axle * 1e-13,
        ];
        for place in places {
            let sphere = Sphere {
                centre: wheel.centre + place,
                radius: 0.05,
            };
            let near = nearest_point(&wheel, &sphere, &Vector3::zeros());
            assert!((near.n.norm() - 1.0).abs() < 1e-12);
            assert!(near.gap.is_finite() && near.point.iter().all(|x| x.is_finite()));
            assert!(near.gap >= -0.05 - 1e-15);
        }
    }
}
