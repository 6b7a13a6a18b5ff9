//! The point of a wheel that is nearest to a place, of one wheel or of several side by side.
//!
//! In the half-plane through the axle and the place a the wheel's section is a rectangle, from −h
//! to h along the axle and up to the circles' radius away from it, rounded by ρ; that of a disc is
//! a line (h = ρ = 0). With the point E of the rectangle nearest to a, at the distance d (negative
//! inside),
//!
//! ```text
//! distance = d − ρ,   n = unit(E − a) (inside unit(a − E)),   point = E − ρ n
//! ```
//!
//! E is a clamped to the rectangle: over the tread it keeps its place along the axle, over a side
//! face its distance from the axle, and else it is on a circle. Inside it is on the nearest of
//! tread and sides. E, n and the distance are continuous where one turns into the other.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::geometry::Roller;
use friction_contact::scalar::{Lane, LaneMask, Vec3};

/// Lengths below which a direction is not taken from a difference, m.
pub(super) const NO_DIRECTION: f64 = 1e-12;

/// Section of a wheel through its axle.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Radius of the circles, m.
    pub radius: f64,
    /// Distance of the circles from the middle, m; 0 for a disc and a torus.
    pub half: f64,
    /// ρ, m.
    pub rounding: f64,
}

/// A wheel's point at a place.
#[derive(Clone, Copy, Debug)]
pub struct SectionPoint<T> {
    /// From the wheel's centre, m.
    pub point: Vec3<T>,
    /// Unit normal, from the place to the wheel.
    pub n: Vec3<T>,
    /// Unit, from the axle to the place.
    pub outward: Vec3<T>,
    /// From the place, m; negative inside.
    pub distance: T,
}

impl Section {
    /// Section of a wheel.
    #[inline]
    #[must_use]
    pub fn of(roller: &Roller) -> Self {
        Self {
            radius: roller.core.radius,
            half: roller.half,
            rounding: roller.rounding,
        }
    }

    /// Distance (m) of a place from a wheel with the unit axle `s`, negative inside; `offset`: the
    /// place from the wheel's centre, m.
    #[inline(always)]
    pub fn distance<T: Lane>(&self, s: Vec3<T>, offset: Vec3<T>) -> T {
        let along = offset.dot(s);
        let zero = along.like(0.0);
        let beside = along.abs() - along.like(self.half);
        let beyond = (offset - s * along).norm() - along.like(self.radius);
        let (side, out) = (beside.max(zero), beyond.max(zero));
        let mut distance = (side * side + out * out).sqrt();
        if self.half > 0.0 {
            let inside = beside.lt(zero) & beyond.lt(zero);
            distance = T::select(inside, beside.max(beyond), distance);
        }
        distance - along.like(self.rounding)
    }

    /// The point nearest to a place, with the arguments of [`Self::distance`].
    ///
    /// Where the place is on the axle, the direction outward is the one that `spoke` gives, a unit
    /// vector across the axle. On a side face itself n is along the axle. On a disc and on the edge
    /// of a face it points inward, so that a sphere right in its way pushes the wheel back and not
    /// over.
    #[inline(always)]
    pub fn nearest<T: Lane>(
        &self,
        s: Vec3<T>,
        offset: Vec3<T>,
        spoke: impl FnOnce() -> Vec3<T>,
    ) -> SectionPoint<T> {
        let along = offset.dot(s);
        let (zero, one) = (along.like(0.0), along.like(1.0));
        let (radius, half) = (along.like(self.radius), along.like(self.half));
        let least = along.like(NO_DIRECTION);
        let across = offset - s * along;
        let away = across.norm();
        let mut outward = across * (one / away);
        let on_axle = away.le(least);
        if on_axle.any() {
            outward = Vec3::select(on_axle, spoke(), outward);
        }
        let (mut out, mut place) = (away.min(radius), zero);
        let mut reach = outward * out;
        let mut inside = T::mask(along.token(), 0);
        if self.half > 0.0 {
            place = along.max(-half).min(half);
            reach += s * place;
            inside = away.lt(radius) & along.abs().lt(half);
        }
        let toward = reach - offset;
        let mut distance = toward.norm();
        let mut n = toward * (one / distance);
        let sign = T::select(along.lt(zero), -one, one);
        let on_it = distance.le(least) & !inside;
        if on_it.any() {
            n = Vec3::select(on_it, -outward, n);
            if self.half + self.rounding > 0.0 {
                n = Vec3::select(on_it & away.lt(radius), s * -sign, n);
            }
        }
        if inside.any() {
            let depths = [radius - away, half - along.abs()];
            let tread = inside & depths[0].le(depths[1]);
            let face = inside & !tread;
            out = T::select(tread, radius, out);
            place = T::select(face, sign * half, place);
            reach = outward * out + s * place;
            distance = T::select(tread, -depths[0], T::select(face, -depths[1], distance));
            n = Vec3::select(tread, -outward, Vec3::select(face, s * -sign, n));
        }
        let mut point = reach;
        if self.rounding > 0.0 {
            let rounding = along.like(self.rounding);
            point = reach - n * rounding;
            distance -= rounding;
        }
        SectionPoint {
            point,
            n,
            outward,
            distance,
        }
    }
}
