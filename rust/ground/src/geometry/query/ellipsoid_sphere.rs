//! Ellipsoid on a sphere: the point of the ellipsoid nearest to the sphere's centre.
//!
//! In the ellipsoid's axes the nearest point of the surface to a place x is
//! `q_i = a_i² x_i / (t + a_i²)`, with the largest root t of `Σ (a_i x_i / (t + a_i²))² = 1`:
//! positive outside, negative inside. With the smallest semi-axis a, the ratios `r_i = (a_i/a)²`
//! and `u = t/a² + 1` the sum is convex and falls on u > 0, so Newton's iteration from a place on
//! its left never passes the root. A place between the nearest points of both sides, where the
//! smallest axis is across and x has no part of it, takes one of them.
//!
//! `gap = n_out · (x − q) − r_s`. The nearest point minimises over the ellipsoid, so the gap's
//! gradient is nᵀ times the Jacobian of the material point.
//!
//! Source: Eberly 2011 (distance from a point to an ellipsoid).

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint};
use crate::geometry::{Ellipsoid, Sphere, SupportMap};

/// Most steps of Newton's iteration; random places take about six.
const MAX_ITERATIONS: usize = 100;

/// Nearest point of the surface, unit normal into the ellipsoid and signed distance of a place x,
/// all in the ellipsoid's axes.
#[must_use]
pub fn nearest_local(x: &Vector3<f64>, radii: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>, f64) {
    let least = radii.min();
    let r = radii.map(|a| (a / least) * (a / least));
    let z = x.component_div(radii).abs();
    let sum = |u: f64| {
        let terms = Vector3::from_fn(|k, _| {
            let over = u + (r[k] - 1.0);
            if over > 0.0 { r[k] * z[k] / over } else { 0.0 }
        });
        let slopes = Vector3::from_fn(|k, _| {
            let over = u + (r[k] - 1.0);
            if over > 0.0 {
                terms[k] * terms[k] / over
            } else {
                0.0
            }
        });
        (terms.norm_squared() - 1.0, -2.0 * slopes.sum())
    };
    let starts = Vector3::from_fn(|k, _| r[k] * z[k] - (r[k] - 1.0));
    let mut u = starts.max().max(0.0);
    for _ in 0..MAX_ITERATIONS {
        let (value, slope) = sum(u);
        // On the left of the root the value is positive; rounding may make it negative at the end.
        if value <= 0.0 || slope >= 0.0 {
            break;
        }
        let next = u - value / slope;
        if next <= u {
            break;
        }
        u = next;
    }
    let mut q = Vector3::from_fn(|k, _| {
        let over = u + (r[k] - 1.0);
        if over > 0.0 { r[k] * x[k] / over } else { 0.0 }
    });
    let rest = 1.0 - q.component_div(radii).norm_squared();
    if u <= 0.0 && rest > 0.0 {
        // Between the two sides: up along the smallest axis.
        let k = radii.imin();
        q[k] = radii[k] * rest.sqrt();
    }
    let outward = q.component_div(&radii.component_mul(radii));
    let outward = outward.try_normalize(0.0).unwrap_or_else(Vector3::y);
    (q, -outward, outward.dot(&(x - q)))
}

/// Nearest point of an ellipsoid; `base` (m, world) is where its coordinates have their origin.
#[must_use]
pub fn nearest_point(solid: &Ellipsoid, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let local = solid.R.tr_mul(&(sphere.centre - base - solid.centre));
    let (point, n, distance) = nearest_local(&local, &solid.radii);
    let point = solid.centre + solid.R * point;
    SurfacePoint::of_normal(NEAREST, point, &(solid.R * n), distance - sphere.radius)
}

/// The ellipsoid's point over the tangent plane (normal n) at the point `touch` where a sphere was
/// first met.
#[must_use]
pub fn point_over_tangent(
    solid: &Ellipsoid,
    n: &Vector3<f64>,
    touch: &Vector3<f64>,
) -> SurfacePoint {
    let point = solid.support(&-n);
    SurfacePoint::of_normal(NEAREST, point, n, n.dot(&(point - touch)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn no_point_of_the_surface_is_nearer(
            x in prop::array::uniform3(-1.0..1.0), radii in prop::array::uniform3(0.05..1.0),
            other in prop::array::uniform3(-1.0..1.0), flat in 0..4_usize, round in any::<bool>(),
        ) {
            let (mut x, mut radii) = (Vector3::from(x), Vector3::from(radii));
            if flat < 3 {
                x[flat] = 0.0;
            }
            if round {
                radii.y = radii.x;
            }
            let (q, n, distance) = nearest_local(&x, &radii);
            prop_assert!((q.component_div(&radii).norm() - 1.0).abs() < 1e-12);
            prop_assert!((x - q + n * distance).norm() < 1e-9, "{x:?} {radii:?} {q:?} {distance}");
            let is_inside = x.component_div(&radii).norm() < 1.0;
            prop_assert!(is_inside == (distance < 0.0) || distance.abs() < 1e-12);
            let unit = Vector3::from(other).try_normalize(1e-3).unwrap_or_else(Vector3::y);
            let on_surface = unit.component_mul(&radii);
            prop_assert!(distance.abs() <= (on_surface - x).norm() + 1e-12);
            let beside = (q.component_div(&radii) + Vector3::from(other) * 1e-2).normalize();
            prop_assert!(distance.abs() <= (beside.component_mul(&radii) - x).norm() + 1e-12);
        }
    }

    #[test]
    fn the_centre_is_as_deep_as_the_smallest_axis_is_long() {
        for radii in [[0.3, 0.2, 0.4], [0.2; 3], [0.2, 0.2, 0.5]] {
            let (q, n, distance) = nearest_local(&Vector3::zeros(), &radii.into());
            assert!(
                (distance + 0.2).abs() < 1e-15 && (n.norm() - 1.0).abs() < 1e-15,
                "{q:?}"
            );
        }
    }
}
