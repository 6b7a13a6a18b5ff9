//! Wheel on a sphere: the point of the disc nearest to the sphere's centre.
//!
//! A wheel is a disc of radius R, centre c, unit axle s; the sphere has centre a and radius r_s. With `b0 = a − ((a − c)·s) s`, the projection of a
//! onto the wheel's plane, the nearest point E of the disc is
//!
//! ```text
//! E = c + R unit(b0 − c)   where |b0 − c| ≥ R (the rim),   else b0 (the face: a rock struck from the side)
//! gap = |a − E| − r_s,     n = unit(E − a)
//! ```
//!
//! The nearest point minimises over the disc, so the gap's gradient is nᵀ times the Jacobian of the *material* point at E, on
//! the rim and on the face (envelope theorem), and E, n and the gap are continuous where one turns into the other.

use nalgebra::Vector3;

use super::contact_frame::ContactFrame;
use super::wheel_plane::PlacedWheel;
use crate::geometry::Sphere;

/// Lengths below which a direction is not taken from a difference, m.
const NO_DIRECTION: f64 = 1e-12;

/// Nearest point of a wheel: place, frame, gap.
#[derive(Clone, Copy, Debug)]
pub struct NearestPoint {
    /// E, m.
    pub point: Vector3<f64>,
    /// Frame of the contact, n from the sphere to the wheel.
    pub frame: ContactFrame,
    /// m, negative where the sphere's surface is beyond E; never below −r_s.
    pub gap: f64,
}

/// Nearest point of the disc to the sphere's centre; `base` is where the wheel's coordinates have their origin.
///
/// Where a is on the disc itself no direction leads out. Then n is in the wheel's plane, towards the wheel's centre: a sphere
/// right in the wheel's way pushes it back and not over. Where a is the wheel's centre it is the spoke.
#[inline]
#[must_use]
pub fn nearest_point(wheel: &PlacedWheel, sphere: &Sphere, base: &Vector3<f64>) -> NearestPoint {
    let s = &wheel.axle;
    let offset = sphere.centre - base - wheel.centre;
    let across = s * offset.dot(s);
    let in_plane = offset - across;
    let distance_in_plane = in_plane.norm();
    let outward = if distance_in_plane > NO_DIRECTION {
        in_plane / distance_in_plane
    } else {
        wheel.spoke
    };
    // c to E
    let reach = outward * distance_in_plane.min(wheel.radius);
    let from_centre = reach - offset;
    let distance = from_centre.norm();
    let n = if distance > NO_DIRECTION {
        from_centre / distance
    } else {
        -outward
    };
    // On the face n is along the axle: t is then the rim's direction, which it has where rim turns into face.
    NearestPoint {
        point: wheel.centre + reach,
        frame: ContactFrame::of_wheel(&n, s, &s.cross(&outward)),
        gap: distance - sphere.radius,
    }
}

/// Nearest point of the disc to the tangent plane (normal n) at the point `touch` where a sphere was first met.
///
/// For a wheel that may be past the sphere by now; `touch` in the axes of `base`. The point of the rim that is deepest under
/// the plane, or, where the plane was met by the face, the disc's point over `touch`.
#[inline]
#[must_use]
pub fn point_over_tangent(
    wheel: &PlacedWheel,
    n: &Vector3<f64>,
    touch: &Vector3<f64>,
) -> NearestPoint {
    let s = &wheel.axle;
    let w = n - s * n.dot(s);
    let length = w.norm();
    let offset = touch - wheel.centre;
    let in_plane = offset - s * offset.dot(s);
    let reach = if length > FLAT {
        w * (-wheel.radius / length)
    } else {
        in_plane * (wheel.radius / in_plane.norm().max(wheel.radius))
    };
    NearestPoint {
        point: wheel.centre + reach,
        frame: ContactFrame::of_wheel(n, s, &wheel.spoke),
        gap: n.dot(&(reach - offset)),
    }
}

/// Sine of the angle between axle and normal below which a wheel is met with its face and not with its rim: what a wheel
/// turns in a step that is long enough to pass a sphere is less.
const FLAT: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(a: f64, b: f64) -> Vector3<f64> {
        Vector3::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos())
    }

    fn wheel(a: f64, b: f64) -> PlacedWheel {
        let axle = unit(a, b);
        PlacedWheel {
            centre: Vector3::new(0.3, 0.1, -0.2),
            axle,
            spoke: ContactFrame::of_normal(&axle).t,
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
            prop_assert!((outward - near.frame.n * (near.gap + sphere.radius)).norm() < 1e-12);
            let side = wheel.axle.cross(&wheel.spoke);
            let other = (wheel.spoke * f64::cos(phi) + side * f64::sin(phi)) * (wheel.radius * share);
            prop_assert!(near.gap <= sphere.distance(&(base + wheel.centre + other)) + 1e-12);
        }

        #[test]
        fn the_frame_is_continuous_where_the_rim_turns_into_the_face(phi in 0.0..6.3, h in 0.01..0.5) {
            let wheel = wheel(0.3, 0.2);
            let out = wheel.spoke * f64::cos(phi) + wheel.axle.cross(&wheel.spoke) * f64::sin(phi);
            let at = |share: f64| {
                let centre = wheel.centre + out * (wheel.radius * share) + wheel.axle * h;
                nearest_point(&wheel, &Sphere { centre, radius: 0.1 }, &Vector3::zeros())
            };
            let (rim, face) = (at(1.0 + 1e-7), at(1.0 - 1e-7));
            prop_assert!((rim.point - face.point).norm() < 1e-6 && (rim.gap - face.gap).abs() < 1e-6);
            prop_assert!((rim.frame.n - face.frame.n).norm() < 1e-4);
            prop_assert!((rim.frame.t - face.frame.t).norm() < 1e-4, "{:?} {:?}", rim.frame, face.frame);
        }
    }

    #[test]
    fn degenerate_positions_have_frames() {
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
            let R = nalgebra::Matrix3::from_rows(&near.frame.rows().map(|r| r.transpose()));
            assert!((R * R.transpose() - nalgebra::Matrix3::identity()).norm() < 1e-12);
            assert!(near.gap.is_finite() && near.point.iter().all(|x| x.is_finite()));
            assert!(near.gap >= -0.05 - 1e-15);
        }
    }
}
