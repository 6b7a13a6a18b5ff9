//! Wheel with a width on a plane: the lowest points of its two circles.
//!
//! Each circle touches like the rim of a disc ([`super::disc_plane`]), lowered along the normal by
//! the rounding ρ: `gap − ρ` at the point `E − ρ n`. A wheel that stands upright so rests on two
//! points as far apart as its tread is wide, and a torus on one. As the wheel leans one gap grows
//! and the other shrinks, both continuously.
//!
//! The same holds for a cylinder. The circles of a capsule have no radius and one point each: it
//! lies on the lowest points of its two ends.
//!
//! The feature is [`CIRCLE`] times the circle's number plus the number of its rim point.

use nalgebra::Vector3;

use super::{CIRCLE, NEAREST, SurfacePoint, disc_plane};
use crate::geometry::{Plane, Roller};

/// Points whose gap is at most `reach`; `base` as in [`super::dispatch`].
#[inline]
pub fn rim_points(
    roller: &Roller,
    plane: &Plane,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    for k in 0..roller.n_circles() {
        let (circle, reach) = (roller.circle(k), reach + roller.rounding);
        let is_point = circle.radius <= 0.0; // the end of a capsule
        disc_plane::rim_points(&circle, plane, base, reach, |point| {
            if point.feature == NEAREST || !is_point {
                visit(&swept(roller, k, *point));
            }
        });
    }
}

/// The point of a feature, wherever it is.
#[inline]
#[must_use]
pub fn rim_point(
    roller: &Roller,
    plane: &Plane,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    let k = feature / CIRCLE;
    let point = disc_plane::rim_point(&roller.circle(k), plane, base, feature % CIRCLE);
    swept(roller, k, point)
}

/// The lowest point of all.
#[inline]
#[must_use]
pub fn lowest_point(roller: &Roller, plane: &Plane, base: &Vector3<f64>) -> SurfacePoint {
    let is_second = roller.half > 0.0 && roller.core.axle.dot(plane.normal()) > 0.0;
    rim_point(roller, plane, base, if is_second { CIRCLE } else { 0 })
}

/// The wheel's point for a point of its circle `k`.
#[inline]
#[must_use]
pub(super) fn swept(roller: &Roller, k: usize, point: SurfacePoint) -> SurfacePoint {
    SurfacePoint {
        feature: CIRCLE * k + point.feature,
        point: point.point - point.n * roller.rounding,
        gap: point.gap - roller.rounding,
        ..point
    }
}
