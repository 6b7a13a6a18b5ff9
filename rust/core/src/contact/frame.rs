//! The frame (n, t, b) of a contact: normal, rolling direction, binormal.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::geometry::PlacedShape;
use crate::geometry::query::disc_plane::{FLAT, rolling};
use crate::geometry::query::{PairPoint, SurfacePoint};
use crate::scalar::Vec3;

/// Right-handed orthonormal frame in world axes; `b = t × n`, so `(t, n, b)` corresponds to (x, y,
/// z).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactFrame {
    /// From the ground, or from the other body, to the contact's own part.
    pub n: Vector3<f64>,
    /// Rolling direction: forward if the axle points to the right.
    pub t: Vector3<f64>,
    /// `t × n`; zero where rollers turn freely.
    pub b: Vector3<f64>,
}

/// Distance from the axle below which a point of a wheel has no direction along the rim, m.
const ON_AXLE: f64 = 1e-9;

impl ContactFrame {
    /// Frame of a wheel with unit axle `s`. If the wheel lies flat, its `spoke` defines t.
    #[inline]
    #[must_use]
    pub fn of_wheel(n: &Vector3<f64>, s: &Vector3<f64>, spoke: &Vector3<f64>) -> Self {
        let (rolling, length) = rolling(Vec3::from(*n), Vec3::from(*s));
        let t = if length > FLAT {
            rolling.into()
        } else {
            (spoke - n * n.dot(spoke)).normalize()
        };
        Self {
            n: *n,
            t,
            b: t.cross(n),
        }
    }

    /// Frame without a preferred direction: t lies along the world's x axis, or along z if n lies
    /// along x.
    #[must_use]
    pub fn of_normal(n: &Vector3<f64>) -> Self {
        let e = if n.x.abs() < 0.9 {
            Vector3::x()
        } else {
            Vector3::z()
        };
        let t = (e - n * n.dot(&e)).normalize();
        Self {
            n: *n,
            t,
            b: t.cross(n),
        }
    }

    /// Frame of a shape at a point of the ground; a disc has a rolling direction.
    #[inline]
    #[must_use]
    pub fn on_ground(shape: &PlacedShape<'_>, point: &SurfacePoint) -> Self {
        match shape.wheel() {
            Some(disc) => Self::of_wheel(&point.n, &disc.axle, &point.rolling),
            None => Self::of_normal(&point.n),
        }
    }

    /// Frame of a shape, the second of its pair, in contact with another.
    #[must_use]
    pub fn of_pair(shape: &PlacedShape<'_>, point: &PairPoint) -> Self {
        let Some(disc) = shape.wheel() else {
            return Self::of_normal(&point.n);
        };
        // A disc in contact on its face rolls along its rim.
        let along_rim = disc.axle.cross(&(point.point - disc.centre));
        let along_rim = along_rim.try_normalize(ON_AXLE).unwrap_or(disc.spoke);
        Self::of_wheel(&point.n, &disc.axle, &along_rim)
    }

    /// n, t, b in this order.
    #[inline]
    #[must_use]
    pub fn rows(&self) -> [Vector3<f64>; 3] {
        [self.n, self.t, self.b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_also_where_the_axle_is_the_normal() {
        let n = Vector3::new(0.1, 0.9, -0.2).normalize();
        for s in [Vector3::z(), n, -n, Vector3::new(0.5, 0.5, 0.1).normalize()] {
            let spoke = if (s - n).norm() < 1e-3 || (s + n).norm() < 1e-3 {
                (Vector3::x() - n * n.x).normalize()
            } else {
                Vector3::x()
            };
            for frame in [
                ContactFrame::of_wheel(&n, &s, &spoke),
                ContactFrame::of_normal(&n),
            ] {
                let R = nalgebra::Matrix3::from_rows(&frame.rows().map(|r| r.transpose()));
                assert!((R * R.transpose() - nalgebra::Matrix3::identity()).norm() < 1e-14);
            }
        }
        let flat = ContactFrame::of_wheel(&Vector3::y(), &Vector3::z(), &Vector3::x());
        assert!((flat.t - Vector3::x()).norm() < 1e-15 && (flat.b - Vector3::z()).norm() < 1e-15);
    }

    #[test]
    fn the_frame_is_continuous_where_the_rim_turns_into_the_face() {
        use crate::geometry::query::roller_sphere::nearest_point;
        use crate::geometry::{Disc, Roller, Sphere};
        let axle = Vector3::new(0.3, 0.2, 0.9).normalize();
        let spoke = ContactFrame::of_normal(&axle).t;
        let disc = Disc {
            centre: Vector3::new(0.3, 0.1, -0.2),
            axle,
            spoke,
            radius: 0.3,
        };
        for phi in [0.0, 1.0, 2.5, 4.0, 6.0_f64] {
            let out = spoke * phi.cos() + axle.cross(&spoke) * phi.sin();
            let at = |share: f64| {
                let centre = disc.centre + out * (disc.radius * share) + axle * 0.1;
                let ground = Sphere::new(centre, 0.05);
                let near = nearest_point(&Roller::thin(disc), &ground, &Vector3::zeros());
                (
                    near,
                    ContactFrame::on_ground(&PlacedShape::Disc(disc), &near),
                )
            };
            let (rim, face) = (at(1.0 + 1e-7), at(1.0 - 1e-7));
            assert!((rim.0.point - face.0.point).norm() < 1e-6);
            assert!((rim.0.gap - face.0.gap).abs() < 1e-6);
            assert!((rim.1.n - face.1.n).norm() < 1e-4);
            assert!((rim.1.t - face.1.t).norm() < 1e-4, "{rim:?} {face:?}");
        }
    }
}
