//! Two discs: wheels that meet.
//!
//! A disc has no width. Two discs that cross would separate by the shortest way, sideways, and pass
//! through each other. Each disc therefore gets a tyre, a rim rounded off by `r = R / 4`: a flat
//! disc of radius `R − r` grown by r all round. Then
//!
//! ```text
//! gap = |E₂ − E₁| − r₁ − r₂,    n = unit(E₂ − E₁),    E_i the nearest points of the two flat discs
//! ```
//!
//! which is smooth as long as the tyres overlap by less than `r₁ + r₂`. Deeper than that the normal
//! is the line of centres. Against all other shapes a disc stays flat.

use super::{NEAREST, PairPoint, convex};
use crate::geometry::{Disc, SupportMap};

/// Radius of the rounded rim, as a fraction of the disc's.
const TYRE: f64 = 0.25;

/// Distance of the flat discs, relative to their size, below which they count as crossing.
const CROSSING: f64 = 1e-6;

/// Distance of the centres, relative to the discs' size, below which their line has no direction.
const NO_DIRECTION: f64 = 1e-9;

/// Nearest points of two tyres.
#[must_use]
pub fn nearest_points(first: &Disc, second: &Disc) -> PairPoint {
    let (tyre, other) = (TYRE * first.radius, TYRE * second.radius);
    let flat = |disc: &Disc, tyre: f64| Disc {
        radius: disc.radius - tyre,
        ..*disc
    };
    let (inner, outer) = (flat(first, tyre), flat(second, other));
    let near = convex::nearest_points(&inner, &outer);
    let size = first.radius + second.radius;
    if near.gap > CROSSING * size {
        let gap = near.gap - tyre - other;
        return PairPoint::from_first(NEAREST, &(near.on_first() + near.n * tyre), &near.n, gap);
    }
    let between = second.centre - first.centre;
    let distance = between.norm();
    let n = if distance > NO_DIRECTION * size {
        between / distance
    } else {
        first.axle
    };
    let x = inner.support(&n) + n * tyre;
    let gap = n.dot(&(outer.support(&-n) - x)) - other;
    PairPoint::from_first(NEAREST, &x, &n, gap)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn disc(centre: [f64; 3], axle: [f64; 3], radius: f64) -> Disc {
        let axle = Vector3::from(axle).normalize();
        Disc {
            centre: centre.into(),
            axle,
            spoke: super::super::any_tangent(&axle),
            radius,
        }
    }

    #[test]
    fn wheels_that_meet_head_on_part_along_the_line_of_centres() {
        let first = disc([0.0; 3], [0.0, 0.0, 1.0], 0.2);
        for (x, gap) in [(0.31, 0.01), (0.3, 0.0), (0.25, -0.05), (0.1, -0.2)] {
            let near = nearest_points(&first, &disc([x, 0.0, 0.0], [0.0, 0.0, 1.0], 0.1));
            assert!((near.gap - gap).abs() < 1e-9, "{x}: {near:?}");
            assert!((near.n - Vector3::x()).norm() < 1e-6);
            assert!((near.point - Vector3::x() * (0.2 + 0.5 * gap)).norm() < 1e-6);
        }
    }

    #[test]
    fn a_rim_that_meets_a_face_does_so_along_the_axle() {
        let first = disc([0.0; 3], [0.0, 1.0, 0.0], 0.4);
        let second = disc([0.05, 0.31, 0.0], [0.0, 0.0, 1.0], 0.2);
        let near = nearest_points(&first, &second);
        assert!((near.n - Vector3::y()).norm() < 1e-6);
        assert!((near.gap - (0.31 - 0.2 - 0.1)).abs() < 1e-9, "{near:?}");
        let same = nearest_points(&first, &first);
        assert!(same.gap < 0.0 && (same.n - first.axle).norm() < 1e-12);
    }

    proptest! {
        #[test]
        fn both_sides_see_the_same_and_no_direction_parts_tyres_further(
            x in prop::array::uniform3(-0.5..0.5), axles in (prop::array::uniform3(-1.0..1.0), prop::array::uniform3(-1.0..1.0)),
            d in prop::array::uniform3(-1.0..1.0),
        ) {
            let first = disc([0.0; 3], axles.0, 0.2);
            let second = disc(x, axles.1, 0.3);
            let (near, back) = (nearest_points(&first, &second), nearest_points(&second, &first));
            prop_assert!((near.gap - back.gap).abs() < 1e-8);
            let is_crossing = near.gap < -0.1249;
            if !is_crossing {
                prop_assert!((near.n + back.n).norm() < 1e-3 && (near.point - back.point).norm() < 1e-2);
                let separation = |n: &Vector3<f64>| {
                    let width = |disc: &Disc, n: &Vector3<f64>| {
                        0.75 * disc.radius * (1.0 - disc.axle.dot(n).powi(2)).max(0.0).sqrt() + 0.25 * disc.radius
                    };
                    n.dot(&(second.centre - first.centre)) - width(&first, n) - width(&second, n)
                };
                prop_assert!((separation(&near.n) - near.gap).abs() < 1e-7);
                prop_assert!(separation(&Vector3::from(d).try_normalize(1e-3).unwrap_or_else(Vector3::y)) <= near.gap + 1e-8);
            }
        }
    }
}
