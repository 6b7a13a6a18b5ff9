//! A ray and a box: the three pairs of faces as slabs (Kay and Kajiya 1986).

use super::{Hit, Ray};
use crate::geometry::shape::OrientedBox;

/// Where a ray crosses the surface of a box within `reach` (m), from outside or from within.
#[inline]
#[must_use]
pub fn hit(ray: &Ray, solid: &OrientedBox, reach: f64) -> Option<Hit> {
    let from = solid.R.tr_mul(&(ray.origin - solid.centre));
    let along = solid.R.tr_mul(&ray.direction);
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    let (mut enters_by, mut leaves_by) = (0, 0);
    for k in 0..3 {
        let half = solid.half_size[k];
        if along[k].abs() < f64::MIN_POSITIVE {
            if from[k].abs() > half {
                return None;
            }
            continue;
        }
        let near = (-half.copysign(along[k]) - from[k]) / along[k];
        let far = (half.copysign(along[k]) - from[k]) / along[k];
        if near > enter {
            (enter, enters_by) = (near, k);
        }
        if far < leave {
            (leave, leaves_by) = (far, k);
        }
    }
    let (distance, k, side) = if enter >= 0.0 {
        (enter, enters_by, -1.0)
    } else {
        (leave, leaves_by, 1.0)
    };
    let is_met = enter <= leave && distance >= 0.0 && distance <= reach;
    is_met.then(|| Hit {
        distance,
        normal: solid.axis(k) * (side * along[k].signum()),
    })
}
