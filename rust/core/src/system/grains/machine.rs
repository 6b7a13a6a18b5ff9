//! A machine among grains: a few coordinates, a dense mass matrix, and wheels that touch grains.

use std::fmt::Debug;

use nalgebra::{SVector, Vector3};

/// A wheel's disc or ball in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheel<const D: usize> {
    /// m.
    pub centre: SVector<f64, D>,
    /// m.
    pub radius: f64,
}

/// A machine of [`Self::nv`] coordinates whose velocities are their rates.
///
/// The first D coordinates are a place in the world, m; the others angles,
/// rad. Matrices are row-major.
pub trait Machine<const D: usize>: Debug + Send + Sync {
    /// Number of coordinates.
    fn nv(&self) -> usize;

    /// `M(q)` (nv × nv), kg, kg m, kg m².
    fn mass_matrix(&self, q: &[f64], out: &mut [f64]);

    /// `F(q, v)` (nv), N and N m: gravity (m/s²), torques (`inputs`, N m, positive forward) and
    /// terms quadratic in v, so that `M v̇ = F` without contacts.
    fn force(&self, q: &[f64], v: &[f64], gravity: &Vector3<f64>, inputs: &[f64], out: &mut [f64]);

    /// Potential energy `−Σ m g · x`, J.
    fn potential(&self, q: &[f64], gravity: &Vector3<f64>) -> f64;

    /// Number of torques that can be set.
    fn n_inputs(&self) -> usize;

    /// Number of wheels.
    fn n_wheels(&self) -> usize;

    /// Wheel i.
    fn wheel(&self, i: usize, q: &[f64]) -> Wheel<D>;

    /// Velocity of the material point of wheel i at `point` (world, m) per
    /// unit of each coordinate's rate (D × nv).
    fn point_jacobian(&self, i: usize, q: &[f64], point: &SVector<f64, D>, out: &mut [f64]);

    /// Largest displacement, m, that a change (nv) causes away from the contact points.
    fn displacement(&self, y: &[f64]) -> f64;

    /// A number that is equal for two machines only if they are of the same kind, with the same
    /// masses, inertias and lengths.
    fn fingerprint(&self) -> u64;
}

/// Velocity (m/s) of the material point of wheel i at `point`. `jacobian`: scratch.
pub(super) fn point_velocity<const D: usize>(
    machine: &dyn Machine<D>,
    i: usize,
    (q, v): (&[f64], &[f64]),
    point: &SVector<f64, D>,
    jacobian: &mut Vec<f64>,
) -> SVector<f64, D> {
    jacobian.resize(D * v.len(), 0.0);
    machine.point_jacobian(i, q, point, jacobian);
    SVector::from_fn(|d, _| {
        let row = &jacobian[d * v.len()..(d + 1) * v.len()];
        sum_of_products(row, v)
    })
}

/// `a · b`, from the first entry to the last.
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The machine's matrices in a step: scratch.
#[derive(Clone, Debug, Default)]
pub(super) struct MachineParts {
    nv: usize,
    /// M, row-major.
    mass: Vec<f64>,
    /// Lower factor, `M = L Lᵀ`, row-major.
    L: Vec<f64>,
    /// Rows n, t, (b) of Hᵀ of its contacts (D × nv each).
    rows: Vec<f64>,
    pub jacobian: Vec<f64>,
}

impl MachineParts {
    /// M at a configuration.
    pub fn set_mass<const D: usize>(&mut self, machine: &dyn Machine<D>, q: &[f64]) {
        self.nv = machine.nv();
        self.mass.resize(self.nv * self.nv, 0.0);
        machine.mass_matrix(q, &mut self.mass);
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

    /// Adds a contact of wheel i: stores its rows of Hᵀ and appends those of Zᵀ to `scaled`.
    pub fn push_contact<const D: usize>(
        &mut self,
        machine: &dyn Machine<D>,
        (i, q): (usize, &[f64]),
        point: &SVector<f64, D>,
        frame: &[SVector<f64, D>; D],
        scaled: &mut Vec<f64>,
    ) {
        let n = self.nv;
        self.jacobian.resize(D * n, 0.0);
        machine.point_jacobian(i, q, point, &mut self.jacobian);
        for direction in frame {
            let begin = scaled.len();
            for k in 0..n {
                let column = SVector::<f64, D>::from_fn(|d, _| self.jacobian[d * n + k]);
                scaled.push(column.dot(direction));
            }
            self.rows.extend_from_slice(&scaled[begin..]);
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
        let mut parts = MachineParts {
            nv: 3,
            mass: vec![4.0, 2.0, 0.4, 2.0, 5.0, 1.0, 0.4, 1.0, 3.0],
            ..MachineParts::default()
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
