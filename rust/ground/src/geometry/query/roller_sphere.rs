//! Wheel on a sphere: the point of the wheel nearest to the sphere's centre, by [`super::section`].
//!
//! With a sphere of radius r_s the gap is the distance of its centre from the wheel, less r_s. The
//! nearest point minimises over the wheel, so the gap's gradient is nᵀ times the Jacobian of the
//! *material* point (envelope theorem). A disc is a wheel without width.

use nalgebra::Vector3;

use super::section::{NO_DIRECTION, Section};
use super::{NEAREST, SurfacePoint};
use crate::geometry::{Roller, Sphere};
use friction_contact::scalar::Vec3;

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

/// A place in a wheel.
struct Seen<'a> {
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
    fn at(roller: &'a Roller, offset: &Vector3<f64>) -> Self {
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
    fn depth(&self, side: Side) -> f64 {
        match side {
            Side::Tread => self.roller.core.radius - self.away,
            Side::Near => self.roller.half - self.along.abs(),
            Side::Far => self.roller.half + self.along.abs(),
        }
    }

    /// The wheel's point on the nearest side through which the place may leave along the normal.
    fn nearest_open(&self, is_open: impl Fn(&Vector3<f64>) -> bool) -> Option<SurfacePoint> {
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
    }

    /// The wheel's point on one of its sides.
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

/// The point nearest to a place, which is given from the wheel's centre, m.
#[inline]
pub(super) fn nearest_to(roller: &Roller, offset: &Vector3<f64>) -> SurfacePoint {
    let core = &roller.core;
    let near = Section::of(roller).nearest(Vec3::from(core.axle), Vec3::from(*offset), || {
        Vec3::from(core.spoke)
    });
    SurfacePoint {
        feature: NEAREST,
        point: core.centre + Vector3::from(near.point),
        n: near.n.into(),
        // On a side face n is along the axle; t is then the rim's direction, its limit where the
        // rim meets the face.
        rolling: core.axle.cross(&near.outward.into()),
        gap: near.distance,
    }
}

/// The point for a place that is in the wheel, on the nearest side through which it may leave along
/// the normal; if there is none, the nearest.
#[cold]
pub(super) fn nearest_open(
    roller: &Roller,
    offset: &Vector3<f64>,
    is_open: impl Fn(&Vector3<f64>) -> bool,
) -> SurfacePoint {
    let open = Seen::at(roller, offset).nearest_open(is_open);
    open.unwrap_or_else(|| nearest_to(roller, offset))
}

/// Nearest point of the wheel to a sphere; `base` as in [`super::dispatch`].
#[inline]
#[must_use]
pub fn nearest_point(roller: &Roller, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let near = nearest_to(roller, &(sphere.centre - base - roller.core.centre));
    SurfacePoint {
        gap: near.gap - sphere.radius,
        ..near
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Disc;
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
            let near = nearest_point(&Roller::thin(wheel), &sphere, &base);
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
            let sphere = Sphere::new(wheel.centre + place, 0.05);
            let near = nearest_point(&Roller::thin(wheel), &sphere, &Vector3::zeros());
            assert!((near.n.norm() - 1.0).abs() < 1e-12);
            assert!(near.gap.is_finite() && near.point.iter().all(|x| x.is_finite()));
            assert!(near.gap >= -0.05 - 1e-15);
        }
    }
}
