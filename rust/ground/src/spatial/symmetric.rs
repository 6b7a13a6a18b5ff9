//! Symmetric 3×3 matrix, six numbers: rotational inertia in world axes.

use nalgebra::{Matrix3, Vector3};

/// Symmetric 3×3 matrix (kg m² when it is an inertia).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SymmetricMatrix3 {
    /// Entry (0, 0).
    pub xx: f64,
    /// Entry (1, 1).
    pub yy: f64,
    /// Entry (2, 2).
    pub zz: f64,
    /// Entries (0, 1) and (1, 0).
    pub xy: f64,
    /// Entries (0, 2) and (2, 0).
    pub xz: f64,
    /// Entries (1, 2) and (2, 1).
    pub yz: f64,
}

impl SymmetricMatrix3 {
    /// From the lower triangle of a full matrix.
    #[must_use]
    pub fn from_matrix(m: &Matrix3<f64>) -> Self {
        Self {
            xx: m[(0, 0)],
            yy: m[(1, 1)],
            zz: m[(2, 2)],
            xy: m[(1, 0)],
            xz: m[(2, 0)],
            yz: m[(2, 1)],
        }
    }

    /// Full matrix, with both triangles.
    #[must_use]
    pub fn to_matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.xx, self.xy, self.xz, self.xy, self.yy, self.yz, self.xz, self.yz, self.zz,
        )
    }

    /// `m (|c|² 1 − c cᵀ)`: inertia of a point mass at `c` about the origin (Huygens–Steiner).
    #[inline]
    #[must_use]
    pub fn point_mass(m: f64, c: &Vector3<f64>) -> Self {
        let (x, y, z) = (c.x, c.y, c.z);
        Self {
            xx: m * (y * y + z * z),
            yy: m * (x * x + z * z),
            zz: m * (x * x + y * y),
            xy: -m * x * y,
            xz: -m * x * z,
            yz: -m * y * z,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn agrees_with_full_matrices() {
        let R = *UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.0, 0.7))
            .to_rotation_matrix()
            .matrix();
        let d = Vector3::new(1.0, 2.0, 3.5);
        let full = R * Matrix3::from_diagonal(&d) * R.transpose();
        assert!((SymmetricMatrix3::from_matrix(&full).to_matrix() - full).norm() < 1e-14);
        let c = Vector3::new(0.1, 0.2, -0.4);
        let steiner = -2.0 * c.cross_matrix() * c.cross_matrix();
        assert!((SymmetricMatrix3::point_mass(2.0, &c).to_matrix() - steiner).norm() < 1e-15);
    }
}
