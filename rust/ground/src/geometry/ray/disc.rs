//! A ray and a disc of zero width.

use super::{Hit, Ray};
use crate::geometry::shape::Disc;

/// Where a ray crosses a disc within `reach` (m); the normal faces the ray's origin.
#[inline]
#[must_use]
pub fn hit(ray: &Ray, disc: &Disc, reach: f64) -> Option<Hit> {
    let towards = disc.axle.dot(&ray.direction);
    let distance = disc.axle.dot(&(disc.centre - ray.origin)) / towards;
    let is_met = distance >= 0.0
        && distance <= reach
        && (ray.at(distance) - disc.centre).norm_squared() <= disc.radius * disc.radius;
    is_met.then(|| Hit {
        distance,
        normal: disc.axle * -towards.signum(),
    })
}
