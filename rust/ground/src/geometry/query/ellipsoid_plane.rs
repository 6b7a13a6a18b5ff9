//! Ellipsoid on a plane: its lowest point, `E = c − R S² Rᵀ n / |S Rᵀ n|`, gap
//! `n·c + d − |S Rᵀ n|`.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint};
use crate::geometry::{Ellipsoid, Plane, SupportMap};

/// The lowest point; `base` (m, world) is where the ellipsoid's coordinates have their origin.
#[inline]
#[must_use]
pub fn lowest_point(solid: &Ellipsoid, plane: &Plane, base: &Vector3<f64>) -> SurfacePoint {
    let n = plane.normal();
    let height = plane.distance(base) + n.dot(&solid.centre);
    SurfacePoint::of_normal(NEAREST, solid.support(&-n), n, height - solid.extent(n))
}
