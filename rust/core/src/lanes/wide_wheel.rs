//! Where a wheel with a width touches a plane or a sphere: [`crate::geometry::query::roller_plane`]
//! and [`crate::geometry::query::roller_sphere`] over lanes.

use super::parts::Wheel;
use crate::scalar::{Lane, LaneMask, Vec3};

/// A point of a wheel at a sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest<T: Lane> {
    /// The wheel's point from its centre, m.
    pub point: Vec3<T>,
    /// Unit normal from the sphere to the wheel.
    pub n: Vec3<T>,
    /// Unit, from the axle to the sphere's centre.
    pub outward: Vec3<T>,
    /// Distance from the sphere's centre, m; negative inside.
    pub distance: T,
    /// Where normal or rolling direction are not defined by differences.
    pub undefined: T::Mask,
}

/// Lengths below which a direction is not taken from a difference, m.
const NO_DIRECTION: f64 = 1e-12;

impl Wheel {
    /// Place of a circle along the axle, m.
    #[inline(always)]
    pub(super) fn along(&self, circle: usize) -> f64 {
        if circle == 0 { self.half } else { -self.half }
    }

    /// The point of a wheel with the unit axle `s` that is nearest to a sphere's centre, which lies
    /// `offset` (m) from its own.
    #[inline(always)]
    pub(super) fn nearest<T: Lane>(&self, s: Vec3<T>, offset: Vec3<T>) -> Nearest<T> {
        let radius = offset.x.like(self.radius);
        let (zero, one, half) = (radius.like(0.0), radius.like(1.0), radius.like(self.half));
        let least = radius.like(NO_DIRECTION);
        let along = offset.dot(s);
        let across = offset - s * along;
        let away = across.norm();
        let outward = across * (one / away);
        // The core's point, out from the axle and along it.
        let mut out = away.min(radius);
        let mut place = along.max(-half).min(half);
        let inward = outward * (out - away) + s * (place - along);
        let mut distance = inward.norm();
        let mut n = inward * (one / distance);
        let mut undefined = away.le(least);
        let inside = away.lt(radius) & along.abs().lt(half);
        undefined = undefined | (distance.le(least) & !inside);
        if inside.any() {
            let depths = [radius - away, half - along.abs()];
            let tread = inside & depths[0].le(depths[1]);
            let face = inside & !tread;
            let sign = T::select(along.lt(zero), -one, one);
            out = T::select(tread, radius, out);
            place = T::select(face, sign * half, place);
            distance = T::select(tread, -depths[0], T::select(face, -depths[1], distance));
            n = Vec3::select(tread, -outward, Vec3::select(face, s * -sign, n));
        }
        let rounding = radius.like(self.rounding);
        Nearest {
            point: outward * out + s * place - n * rounding,
            n,
            outward,
            distance: distance - rounding,
            undefined,
        }
    }
}
