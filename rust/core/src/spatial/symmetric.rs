//! Symmetric 3×3 matrix, six numbers: rotational inertia in world axes.

use std::ops::AddAssign;

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

    /// As a full matrix.
    #[must_use]
    pub fn to_matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.xx, self.xy, self.xz, self.xy, self.yy, self.yz, self.xz, self.yz, self.zz,
        )
    }

    /// True where the off-diagonal entries are exactly zero.
    #[must_use]
    pub fn is_diagonal(&self) -> bool {
        self.xy == 0.0 && self.xz == 0.0 && self.yz == 0.0
    }

    /// `R diag(d) Rᵀ`.
    #[inline]
    #[must_use]
    pub fn rotated_diagonal(R: &Matrix3<f64>, d: &Vector3<f64>) -> Self {
        let (a, b, c) = (R.column(0) * d.x, R.column(1) * d.y, R.column(2) * d.z);
        let (p, q, r) = (R.column(0), R.column(1), R.column(2));
        Self {
            xx: a[0] * p[0] + b[0] * q[0] + c[0] * r[0],
            yy: a[1] * p[1] + b[1] * q[1] + c[1] * r[1],
            zz: a[2] * p[2] + b[2] * q[2] + c[2] * r[2],
            xy: a[0] * p[1] + b[0] * q[1] + c[0] * r[1],
            xz: a[0] * p[2] + b[0] * q[2] + c[0] * r[2],
            yz: a[1] * p[2] + b[1] * q[2] + c[1] * r[2],
        }
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

    /// Product with a vector.
    #[inline]
    #[must_use]
    pub fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }
}

impl AddAssign for SymmetricMatrix3 {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.xx += o.xx;
        self.yy += o.yy;
        self.zz += o.zz;
        self.xy += o.xy;
        self.xz += o.xz;
        self.yz += o.yz;
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
        let sym = SymmetricMatrix3::rotated_diagonal(&R, &d);
        assert!((sym.to_matrix() - full).norm() < 1e-14);
        assert!((SymmetricMatrix3::from_matrix(&full).to_matrix() - full).norm() < 1e-14);
        let c = Vector3::new(0.1, 0.2, -0.4);
        let steiner = -2.0 * c.cross_matrix() * c.cross_matrix();
        assert!((SymmetricMatrix3::point_mass(2.0, &c).to_matrix() - steiner).norm() < 1e-15);
        assert!((sym.times(&c) - full * c).norm() < 1e-14);
    }
}
