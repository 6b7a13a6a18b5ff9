//! The matrices of a planar machine in a step: `M = L Lᵀ` and the rows of its contacts.

use nalgebra::Vector2;

use crate::planar::{PlanarPoses, PlanarTree};

/// `a · b`, from the first entry to the last.
pub(super) fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A machine's matrices in a step: scratch.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanarMatrices {
    nv: usize,
    /// M, row-major.
    mass: Vec<f64>,
    /// Lower factor, `M = L Lᵀ`, row-major.
    L: Vec<f64>,
    /// Rows of Hᵀ of its contacts (d × nv each).
    rows: Vec<f64>,
}

impl PlanarMatrices {
    /// M at a configuration.
    pub fn set_mass(&mut self, machine: &PlanarTree, poses: &PlanarPoses) {
        self.nv = machine.nv();
        self.mass.resize(self.nv * self.nv, 0.0);
        machine.mass_matrix(poses, &mut self.mass);
    }

    /// Entry k of M's diagonal.
    pub fn inertia(&mut self, k: usize) -> &mut f64 {
        &mut self.mass[k * self.nv + k]
    }

    /// `M = L Lᵀ`; false if it is not positive definite.
    pub fn factorise(&mut self) -> bool {
        let n = self.nv;
        self.L.clone_from(&self.mass);
        let L = &mut self.L;
        for j in 0..n {
            for k in 0..j {
                let factor = L[j * n + k];
                for i in j..n {
                    L[i * n + j] -= factor * L[i * n + k];
                }
            }
            let pivot = L[j * n + j];
            if pivot.is_nan() || pivot <= 0.0 {
                return false;
            }
            let root = pivot.sqrt();
            L[j * n + j] = root;
            for i in j + 1..n {
                L[i * n + j] /= root;
            }
        }
        true
    }

    /// `out = M v`.
    pub fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(self.mass.chunks_exact(self.nv)) {
            *out = sum_of_products(row, v);
        }
    }

    /// `y ← L⁻¹ y`.
    pub fn forward(&self, y: &mut [f64]) {
        let n = self.nv;
        for i in 0..n {
            let known = sum_of_products(&self.L[i * n..i * n + i], &y[..i]);
            y[i] = (y[i] - known) / self.L[i * n + i];
        }
    }

    /// `y ← L⁻ᵀ y`.
    pub fn backward(&self, y: &mut [f64]) {
        let n = self.nv;
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| self.L[k * n + i] * y[k]).sum();
            y[i] = (y[i] - known) / self.L[i * n + i];
        }
    }

    /// No contact yet.
    pub fn clear_rows(&mut self) {
        self.rows.clear();
    }

    /// Adds a contact of a wheel along some directions: stores its rows of Hᵀ and appends those of
    /// Zᵀ to `scaled`.
    pub fn push_contact(
        &mut self,
        (machine, poses): (&PlanarTree, &PlanarPoses),
        wheel: usize,
        point: &Vector2<f64>,
        directions: &[Vector2<f64>],
        scaled: &mut Vec<f64>,
    ) {
        let begin = self.rows.len();
        machine.push_rows(wheel, poses, point, directions, &mut self.rows);
        for row in self.rows[begin..].chunks_exact(self.nv) {
            let begin = scaled.len();
            scaled.extend_from_slice(row);
            self.forward(&mut scaled[begin..]);
        }
    }

    /// `out += Hᵀ v` of the machine's contact i.
    pub fn add_local(&self, i: usize, v: &[f64], out: &mut [f64]) {
        let size = out.len() * self.nv;
        let rows = self.rows[size * i..size * (i + 1)].chunks_exact(self.nv);
        for (out, row) in out.iter_mut().zip(rows) {
            *out += sum_of_products(row, v);
        }
    }

    /// `out += H p` of the machine's contact i.
    pub fn add_impulse<const D: usize>(&self, i: usize, p: &[f64; D], out: &mut [f64]) {
        let size = D * self.nv;
        let rows = &self.rows[size * i..size * (i + 1)];
        for (k, out) in out.iter_mut().enumerate() {
            *out += (0..D).map(|d| rows[d * self.nv + k] * p[d]).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_solves_with_the_mass_matrix() {
        let mut parts = PlanarMatrices {
            nv: 3,
            mass: vec![4.0, 2.0, 0.4, 2.0, 5.0, 1.0, 0.4, 1.0, 3.0],
            ..PlanarMatrices::default()
        };
        assert!(parts.factorise());
        let v = [0.3, -0.7, 1.1];
        let mut y = [0.0; 3];
        parts.multiply_mass(&v, &mut y);
        parts.forward(&mut y);
        parts.backward(&mut y);
        for (a, b) in y.iter().zip(&v) {
            assert!((a - b).abs() < 1e-15);
        }
        parts.mass[8] = -1.0;
        assert!(!parts.factorise(), "indefinite");
        parts.mass[0] = f64::NAN;
        assert!(!parts.factorise(), "not a number");
    }
}
