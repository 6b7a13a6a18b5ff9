//! A ray and a convex polytope: its faces as half-spaces (Cyrus and Beck 1978).

use super::{Hit, Ray};
use crate::geometry::shape::Hull;

/// Where a ray crosses the surface of a polytope within `reach` (m), from outside or from within.
#[must_use]
pub fn hit(ray: &Ray, hull: &Hull<'_>, reach: f64) -> Option<Hit> {
    let from = hull.local(&ray.origin);
    let along = hull.R.tr_mul(&ray.direction);
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    let (mut enters_by, mut leaves_by) = (0, 0);
    for (k, face) in hull.polytope.faces().iter().enumerate() {
        let (rate, height) = (
            face.normal.dot(&along),
            face.normal.dot(&from) - face.offset,
        );
        if rate.abs() < f64::MIN_POSITIVE {
            if height > 0.0 {
                return None;
            }
            continue;
        }
        let place = -height / rate;
        if rate < 0.0 && place > enter {
            (enter, enters_by) = (place, k);
        } else if rate > 0.0 && place < leave {
            (leave, leaves_by) = (place, k);
        }
    }
    let (distance, k) = if enter >= 0.0 {
        (enter, enters_by)
    } else {
        (leave, leaves_by)
    };
    let is_met = enter <= leave && distance >= 0.0 && distance <= reach;
    is_met.then(|| Hit {
        distance,
        normal: hull.R * hull.polytope.faces()[k].normal,
    })
}
