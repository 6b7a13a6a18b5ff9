//! Wheel with a width on a sphere: the point of the wheel nearest to the sphere's centre.
//!
//! In the half-plane through the axle and the sphere's centre a the wheel is a rectangle, from −h
//! to h along the axle and up to the circles' radius away from it, rounded by ρ. With the point E
//! of the rectangle nearest to a, at the distance d (negative inside),
//!
//! ```text
//! gap = d − ρ − r_s,   n = unit(E − a) (inside unit(a − E)),   point = E − ρ n
//! ```
//!
//! E is the sphere's centre clamped to the rectangle: over the tread it keeps its place along the
//! axle, over a side face its distance from the axle, and else it is on a circle. Inside it is on
//! the nearest of tread and sides. The nearest point minimises over the wheel, so the gap's
//! gradient is nᵀ times the Jacobian of the *material* point.

use nalgebra::Vector3;

use super::{NEAREST, PairPoint, SurfacePoint};
use crate::geometry::{Roller, Sphere};

/// Lengths below which a direction is not taken from a difference, m.
const NO_DIRECTION: f64 = 1e-12;

/// Sine of the angle to the axle or to the tread below which a normal is taken to be along it, for
/// a wheel that passes a sphere. It turns by less in a step that is long enough for that.
const FLAT: f64 = 0.05;

/// A side of the rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Tread,
    /// The nearer of the two faces.
    Near,
    Far,
}

/// A place relative to a wheel.
pub(super) struct Seen<'a> {
    roller: &'a Roller,
    /// Unit, from the axle to the place.
    outward: Vector3<f64>,
    /// From the axle, m.
    away: f64,
    /// Along the axle from the middle, m.
    along: f64,
}

impl<'a> Seen<'a> {
    /// A place given from the wheel's centre, m.
    #[inline]
    pub(super) fn at(roller: &'a Roller, offset: &Vector3<f64>) -> Self {
        let s = &roller.core.axle;
        let along = offset.dot(s);
        let across = offset - s * along;
        let away = across.norm();
        let outward = if away > NO_DIRECTION {
            across / away
        } else {
            roller.core.spoke
        };
        Self {
            roller,
            outward,
            away,
            along,
        }
    }

    /// Depth under a side, m; negative beyond it.
    #[inline]
    fn depth(&self, side: Side) -> f64 {
        match side {
            Side::Tread => self.roller.core.radius - self.away,
            Side::Near => self.roller.half - self.along.abs(),
            Side::Far => self.roller.half + self.along.abs(),
        }
    }

    /// Whether the place is in the wheel's rectangle, without its rounding.
    #[inline]
    fn is_inside(&self) -> bool {
        self.depth(Side::Tread) > 0.0 && self.depth(Side::Near) > 0.0
    }

    /// The wheel's nearest point; for a place that is inside, the one on the nearer side.
    #[inline]
    pub(super) fn nearest(&self) -> SurfacePoint {
        if self.is_inside() {
            let is_tread = self.depth(Side::Tread) <= self.depth(Side::Near);
            return self.through(if is_tread { Side::Tread } else { Side::Near });
        }
        let Roller { core, half, .. } = self.roller;
        let out = self.away.min(core.radius);
        let along = self.along.clamp(-half, *half);
        let inward = self.outward * (out - self.away) + core.axle * (along - self.along);
        let distance = inward.norm();
        // On a face it pushes along the axle, on the edge itself back, and not over.
        let n = if distance > NO_DIRECTION {
            inward / distance
        } else if self.away < core.radius {
            core.axle * -1.0_f64.copysign(self.along)
        } else {
            -self.outward
        };
        self.point([out, along], n, distance)
    }

    /// The wheel's point for a place that is in the wheel, on the nearest side through which it may
    /// leave along the normal; if there is none, the nearest.
    #[cold]
    pub(super) fn nearest_open(&self, is_open: impl Fn(&Vector3<f64>) -> bool) -> SurfacePoint {
        // Abreast of the faces, and under the tread.
        let (beside, under) = (self.depth(Side::Tread), self.depth(Side::Near));
        let sides = [
            (Side::Tread, under),
            (Side::Near, beside),
            (Side::Far, beside),
        ];
        let sides = sides.into_iter().filter(|(_, inside)| *inside > 0.0);
        let open = sides
            .map(|(side, _)| self.through(side))
            .filter(|point| is_open(&point.n));
        open.max_by(|a, b| a.gap.total_cmp(&b.gap))
            .unwrap_or_else(|| self.nearest())
    }

    /// The wheel's point on one of its sides.
    #[inline]
    fn through(&self, side: Side) -> SurfacePoint {
        let Roller { core, half, .. } = self.roller;
        let depth = self.depth(side);
        match side {
            Side::Tread => self.point([core.radius, self.along], -self.outward, -depth),
            Side::Near | Side::Far => {
                let toward = if side == Side::Near {
                    self.along
                } else {
                    -self.along
                };
                let n = core.axle * -1.0_f64.copysign(toward);
                self.point([self.away, half.copysign(toward)], n, -depth)
            }
        }
    }

    /// The wheel's point for one of the rectangle, `distance` (m) away along n.
    #[inline]
    fn point(&self, [out, along]: [f64; 2], n: Vector3<f64>, distance: f64) -> SurfacePoint {
        let Roller { core, rounding, .. } = self.roller;
        let of_core = core.centre + self.outward * out + core.axle * along;
        SurfacePoint {
            feature: NEAREST,
            point: of_core - n * *rounding,
            n,
            // On a side face n is along the axle; t is then the rim's direction, its limit where
            // the rim meets the face.
            rolling: core.axle.cross(&self.outward),
            gap: distance - rounding,
        }
    }
}

/// Nearest point of the wheel to a sphere; `base` as in [`super::dispatch`].
#[inline]
#[must_use]
pub fn nearest_point(roller: &Roller, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let near = Seen::at(roller, &(sphere.centre - base - roller.core.centre)).nearest();
    SurfacePoint {
        gap: near.gap - sphere.radius,
        ..near
    }
}

/// Nearest points of a wheel and a ball that moves; n from the wheel to the ball.
#[must_use]
pub fn nearest_points(roller: &Roller, sphere: &Sphere) -> PairPoint {
    let near = nearest_point(roller, sphere, &Vector3::zeros());
    PairPoint::from_first(NEAREST, &near.point, &-near.n, near.gap)
}

/// The wheel's point over the tangent plane (normal n) at the point `touch`
/// where a sphere was first met.
///
/// For a wheel that may already be past the sphere; `touch` in the axes of `base`. The point lies
/// on the deepest circle, tread or side face that the plane is tilted against, and at `touch` along
/// the others.
#[inline]
#[must_use]
pub fn point_over_tangent(roller: &Roller, n: &Vector3<f64>, touch: &Vector3<f64>) -> SurfacePoint {
    let Roller {
        core,
        half,
        rounding,
    } = roller;
    let s = &core.axle;
    let lean = n.dot(s);
    let w = n - s * lean;
    let length = w.norm();
    let offset = touch - core.centre;
    let place = offset.dot(s);
    let across = offset - s * place;
    let out = if length > FLAT {
        w * (-core.radius / length)
    } else {
        across * (core.radius / across.norm().max(core.radius).max(f64::MIN_POSITIVE))
    };
    let along = if lean.abs() > FLAT {
        -half.copysign(lean)
    } else {
        place.clamp(-half, *half)
    };
    let reach = out + s * along - n * *rounding;
    SurfacePoint {
        feature: NEAREST,
        point: core.centre + reach,
        n: *n,
        rolling: core.spoke,
        gap: n.dot(&(reach - offset)),
    }
}
