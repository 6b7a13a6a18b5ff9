//! A ray and a wheel with a width, by Newton's method.
//!
//! With a and b the distances of a place from the axle and along it from the middle, the distance
//! from the surface is `|(max(a − R + ρ, 0), max(|b| − w/2 + ρ, 0))| − ρ`. It is convex along a
//! ray. From a start before the wheel Newton's steps therefore never pass the place where the ray
//! enters, and converge to it quadratically; where the distance no longer falls, the wheel is
//! missed.

use nalgebra::{Matrix3, Vector3};

use super::{Hit, Ray, oriented_box};
use crate::geometry::shape::{OrientedBox, Roller};

/// Distance from the surface that counts as none, m.
const CLOSE: f64 = 1e-10;

/// Most steps. Twelve suffice but for rays that graze an edge.
const STEPS: usize = 60;

/// Signed distance (m) of a place from a wheel, negative inside, and its gradient.
fn signed_distance(roller: &Roller, x: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let from = x - roller.core.centre;
    let along = roller.core.axle.dot(&from);
    let radial = from - roller.core.axle * along;
    let a = radial.norm();
    let outward = if a > 0.0 {
        radial / a
    } else {
        roller.core.spoke
    };
    let axial = roller.core.axle * 1.0_f64.copysign(along);
    let (over, beside) = (a - roller.core.radius, along.abs() - roller.half);
    if over <= 0.0 && beside <= 0.0 {
        return if over > beside {
            (over - roller.rounding, outward)
        } else {
            (beside - roller.rounding, axial)
        };
    }
    let (over, beside) = (over.max(0.0), beside.max(0.0));
    let length = (over * over + beside * beside).sqrt();
    (
        length - roller.rounding,
        (outward * over + axial * beside) / length,
    )
}

/// Where a ray enters a wheel within `reach` (m); a ray that starts in it meets nothing.
#[must_use]
pub fn hit(ray: &Ray, roller: &Roller, reach: f64) -> Option<Hit> {
    let (axle, spoke, radius) = (roller.core.axle, roller.core.spoke, roller.radius());
    let around = OrientedBox {
        centre: roller.core.centre,
        R: Matrix3::from_columns(&[spoke, axle, spoke.cross(&axle)]),
        half_size: Vector3::new(radius, roller.half + roller.rounding, radius),
    };
    if signed_distance(roller, &ray.origin).0 <= 0.0 {
        return None;
    }
    let at_box = oriented_box::hit(ray, &around, f64::INFINITY)?;
    // From within the box it is the place where the ray leaves.
    let enters = at_box.normal.dot(&ray.direction) < 0.0;
    let mut distance = if enters { at_box.distance } else { 0.0 };
    for _ in 0..STEPS {
        let (gap, gradient) = signed_distance(roller, &ray.at(distance));
        if gap <= CLOSE {
            return (distance <= reach).then_some(Hit {
                distance,
                normal: gradient,
            });
        }
        let rate = gradient.dot(&ray.direction);
        if rate >= 0.0 {
            return None;
        }
        distance -= gap / rate;
        if distance > reach {
            return None;
        }
    }
    None
}
