//! Disc on a plane: the lowest points of a rim.
//!
//! The disc has radius R, centre c, unit axle s. With `w = n − (n·s) s` the lowest rim point is
//! `E = c − R w/|w|`, the gap `n·c + d − R |w|`, `|w| = √(1 − (n·s)²)`. By the envelope theorem the
//! gap's gradient is nᵀ times the Jacobian of the *material* point at E, so the contact frame's
//! normal is the plane's, not the in-wheel one.
//!
//! A wheel lying flat touches with its whole rim. Two more rim points, 120 degrees to either side
//! of the lowest, then support it. Their gap is `n·c + d + R |w| / 2`, so they come in continuously
//! as the wheel tips over. Where `|w|` is below `FLAT`, the first point is the end of the wheel's
//! spoke: the lowest point would run around the rim with every tremor, away from its own force.

use nalgebra::Vector3;

use super::SurfacePoint;
use crate::geometry::{Disc, Plane};
use friction_contact::scalar::{Lane, Vec3};

/// Sine of the angle between axle and normal up to which a wheel lies flat. A point of the rim is
/// then at most twice this times the radius higher than the lowest one.
pub const FLAT: f64 = 1e-5;

/// Rolling direction `n × s / |n × s|` of a wheel with the unit axle s over a plane with the unit
/// normal n, and `|n × s|`. All searches for contacts take the lowest point from these numbers, so
/// a contact has the same bits however it was found.
#[inline(always)]
#[allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for
pub fn rolling<T: Lane>(n: Vec3<T>, s: Vec3<T>) -> (Vec3<T>, T) {
    let across = n.cross(s);
    let length = across.norm();
    (across * (length.like(1.0) / length), length)
}

/// From the centre of a wheel of radius R (m) to its lowest point; `rolling`: its rolling
/// direction.
#[inline(always)]
#[allow(clippy::inline_always)] // as above
pub fn to_lowest<T: Lane>(rolling: Vec3<T>, s: Vec3<T>, radius: T) -> Vec3<T> {
    rolling.cross(s) * radius
}

/// Rim points whose gap is at most `reach`, the lowest one first.
///
/// `base` (m, world) is where the disc's coordinates have their origin: the
/// centre's world position is `base + centre`.
#[inline]
pub fn rim_points(
    disc: &Disc,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let rim = Rim::of(disc, plane, base);
    for feature in 0..3 {
        if rim.gap(feature) <= reach {
            visit(&rim.point(feature));
        }
    }
}

/// The rim point of a number, wherever it is.
#[inline]
#[must_use]
pub fn rim_point(disc: &Disc, plane: &Plane, base: &Vector3<f64>, feature: usize) -> SurfacePoint {
    Rim::of(disc, plane, base).point(feature)
}

/// The rim point of a number over the plane with the unit normal n through
/// a point, all in the disc's coordinates.
#[must_use]
pub fn rim_point_over(
    disc: &Disc,
    n: &Vector3<f64>,
    on_plane: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    Rim::over(disc, n, n.dot(&(disc.centre - on_plane))).point(feature)
}

/// A disc over a plane: what its rim points share.
struct Rim<'a> {
    disc: &'a Disc,
    normal: &'a Vector3<f64>,
    /// Height of the disc's centre over the plane, m.
    height: f64,
    rolling: Vec3<f64>,
    /// `|n × s| = |w|`.
    length: f64,
}

impl<'a> Rim<'a> {
    #[inline]
    fn of(disc: &'a Disc, plane: &'a Plane, base: &Vector3<f64>) -> Self {
        let n = plane.normal();
        Self::over(disc, n, plane.distance(base) + n.dot(&disc.centre))
    }

    #[inline]
    fn over(disc: &'a Disc, n: &'a Vector3<f64>, height: f64) -> Self {
        let (rolling, length) = rolling(Vec3::from(*n), Vec3::from(disc.axle));
        Self {
            disc,
            normal: n,
            height,
            rolling,
            length,
        }
    }

    /// Gap of the rim point of a feature, m.
    #[inline]
    fn gap(&self, feature: usize) -> f64 {
        if self.length <= FLAT {
            return self.height + self.normal.dot(&self.arm(feature));
        }
        let share = if feature == 0 { 1.0 } else { -0.5 };
        self.height - share * self.disc.radius * self.length
    }

    /// From the centre to a point, m.
    #[inline]
    fn arm(&self, feature: usize) -> Vector3<f64> {
        let disc = self.disc;
        let first = if self.length > FLAT {
            to_lowest(self.rolling, Vec3::from(disc.axle), disc.radius).into()
        } else {
            disc.spoke * disc.radius
        };
        let side = || disc.axle.cross(&first) * 0.75_f64.sqrt();
        match feature {
            0 => first,
            1 => first * -0.5 + side(),
            _ => first * -0.5 - side(),
        }
    }

    #[inline]
    fn point(&self, feature: usize) -> SurfacePoint {
        SurfacePoint {
            feature,
            point: self.disc.centre + self.arm(feature),
            n: *self.normal,
            rolling: self.disc.spoke,
            gap: self.gap(feature),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(a: f64, b: f64) -> Vector3<f64> {
        Vector3::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos())
    }

    proptest! {
        #[test]
        fn the_lowest_point_is_lower_than_any_other(a in -3.0..3.0, b in -1.5..1.5, tilt in -0.3..0.3, phi in 0.0..std::f64::consts::TAU) {
            let plane = Plane::new([tilt, 1.0, -tilt], 0.2).unwrap();
            let axle = unit(a, b);
            let spoke = crate::geometry::query::any_tangent(&axle);
            let wheel = Disc { centre: Vector3::new(0.3, 0.1, -0.2), axle, spoke, radius: 0.3 };
            let base = Vector3::new(1.0, 2.0, 3.0);
            let rim = wheel.centre + (spoke * f64::cos(phi) + axle.cross(&spoke) * f64::sin(phi)) * wheel.radius;
            let mut gaps = Vec::new();
            rim_points(&wheel, &plane, &base, 10.0, |p| {
                gaps.push(p.gap);
                // the gap is the height of the point that is named, and that point is on the rim
                assert!((p.gap - plane.distance(&(base + p.point))).abs() < 1e-12);
                assert!(((p.point - wheel.centre).norm() - wheel.radius).abs() < 1e-12);
                assert!((p.point - wheel.centre).dot(&axle).abs() < 1e-12);
            });
            prop_assert_eq!(gaps.len(), 3);
            prop_assert!(gaps[0] <= plane.distance(&(base + rim)) + 1e-12);
        }
    }

    #[test]
    fn a_wheel_lying_flat_stands_on_three_points_around_its_centre() {
        let plane = Plane::ground();
        let wheel = Disc {
            centre: Vector3::zeros(),
            axle: Vector3::y(),
            spoke: Vector3::x(),
            radius: 0.1,
        };
        let mut sum = Vector3::zeros();
        let mut count = 0;
        rim_points(&wheel, &plane, &Vector3::zeros(), 1e-6, |p| {
            assert!(p.gap.abs() < 1e-15);
            sum += p.point;
            count += 1;
        });
        assert_eq!(count, 3);
        assert!(sum.norm() < 1e-15);
    }
}
