//! Ellipsoid.

use nalgebra::{Matrix3, Vector3};

use super::SupportMap;

/// An ellipsoid in space: `|S⁻¹ Rᵀ (x − c)| ≤ 1` with the semi-axes S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// c, m.
    pub centre: Vector3<f64>,
    /// Rotation from the ellipsoid's axes to the world's.
    pub R: Matrix3<f64>,
    /// S, m.
    pub radii: Vector3<f64>,
}

impl Ellipsoid {
    /// Whether a point (m) is in it.
    #[must_use]
    pub fn holds(&self, x: &Vector3<f64>) -> bool {
        let local = self.R.tr_mul(&(x - self.centre));
        local.component_div(&self.radii).norm_squared() <= 1.0
    }

    /// How far it extends from its centre along a vector, in units of that vector's length, m:
    /// `|S Rᵀ d|`.
    #[inline]
    #[must_use]
    pub fn extent(&self, d: &Vector3<f64>) -> f64 {
        self.R.tr_mul(d).component_mul(&self.radii).norm()
    }
}

impl SupportMap for Ellipsoid {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let stretched = self.R.tr_mul(direction).component_mul(&self.radii);
        let length = stretched.norm();
        if length > 0.0 {
            self.centre + self.R * stretched.component_mul(&self.radii) / length
        } else {
            self.centre
        }
    }

    fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    fn bound(&self) -> f64 {
        self.radii.max()
    }
}
