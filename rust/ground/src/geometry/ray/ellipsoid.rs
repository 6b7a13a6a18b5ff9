//! A ray and an ellipsoid: in coordinates where it is a ball of radius 1.

use super::{Hit, Ray, SMALLEST};
use crate::geometry::shape::Ellipsoid;

/// Where a ray crosses an ellipsoid within `reach` (m), from outside or from within.
#[must_use]
pub fn hit(ray: &Ray, solid: &Ellipsoid, reach: f64) -> Option<Hit> {
    let from = solid.R.tr_mul(&(ray.origin - solid.centre));
    let from = from.component_div(&solid.radii);
    let along = solid.R.tr_mul(&ray.direction).component_div(&solid.radii);
    let square = along.norm_squared();
    if square < SMALLEST {
        return None;
    }
    // The place of the line that is nearest to the centre, and half the chord.
    let middle = -from.dot(&along) / square;
    let rest = 1.0 - (from + along * middle).norm_squared();
    if rest < 0.0 {
        return None;
    }
    let half = (rest / square).sqrt();
    let near = middle - half;
    let distance = if near >= 0.0 { near } else { middle + half };
    let place = from + along * distance;
    let out = solid.R * place.component_div(&solid.radii).normalize();
    (distance >= 0.0 && distance <= reach).then_some(Hit {
        distance,
        normal: out,
    })
}
