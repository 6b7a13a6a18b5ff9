//! Implicit gyroscopic terms: the free change of velocity with the Coriolis matrix in the balance.
//!
//! ```text
//! (M̂ + θ h C) Δv = h (τ − G − C v) + J
//! ```
//!
//! C is frozen, `C = C(q_m, v_m)`. Its skew part does no work and rotates the velocity by a Cayley
//! transform, whatever the spin. Its symmetric part `½ Ṁ` can make the matrix singular if a frame
//! rotates by radians in a step. It is then left out for the whole cluster of trees, and the audit
//! ([`crate::integrator::energy_audit`]) corrects the resulting change of the energy.

use nalgebra::{DMatrix, DVector, DVectorView};

use crate::multibody::coriolis::{CoriolisScratch, coriolis_matrix};
use crate::multibody::{Kinematics, MassMatrix, Model};

/// Scratch, filled at the first step that needs it.
#[derive(Clone, Debug, Default)]
pub(super) struct GyroscopicScratch {
    coriolis: CoriolisScratch,
    C: DMatrix<f64>,
    matrix: DMatrix<f64>,
    /// `h (τ − G − C v) + J`, then Δv.
    load: DVector<f64>,
    /// Whether the symmetric part of C is left out, for each cluster.
    is_skew: Vec<bool>,
}

impl GyroscopicScratch {
    /// Turns the impulse `y = h (τ − G)` (nv) into `M̂ Δv − J`, see the page above.
    ///
    /// `mass_matrix` is M̂; `v` the velocity before the step and the one at
    /// which C is frozen; `impulse` is J (nv).
    #[allow(clippy::too_many_arguments)] // the letters of the formula
    pub(super) fn solve(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        mass_matrix: &MassMatrix<f64>,
        (h, theta): (f64, f64),
        (v, v_frozen): (&[f64], &[f64]),
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let nv = model.nv();
        if self.C.nrows() != nv {
            self.C = DMatrix::zeros(nv, nv);
            self.matrix = DMatrix::zeros(nv, nv);
            self.load = DVector::zeros(nv);
        }
        coriolis_matrix(model, kinematics, v_frozen, &mut self.coriolis, &mut self.C);
        let v = DVectorView::from_slice(v, nv);
        let mechanism = model.mechanism();
        self.is_skew.clear();
        self.is_skew.resize(mechanism.n_clusters(), false);
        loop {
            let C = self.C.as_slice();
            for (entry, c) in self.matrix.as_mut_slice().iter_mut().zip(C) {
                *entry = theta * h * c;
            }
            mass_matrix.add_to_dense(mechanism, 0, &mut self.matrix);
            let load = self.load.as_mut_slice();
            for ((load, y), impulse) in load.iter_mut().zip(&*y).zip(impulse) {
                *load = y + impulse;
            }
            self.load.gemv(-h, &self.C, &v, 1.0);
            // If the symmetric part is positive definite, every pivot is positive without row
            // exchanges.
            let change = self.load.as_mut_slice();
            let Some(cluster) = eliminate(model, &mut self.matrix, change, &self.is_skew) else {
                mass_matrix.times(mechanism, change, y);
                for (y, impulse) in y.iter_mut().zip(impulse) {
                    *y -= impulse;
                }
                return;
            };
            self.is_skew[cluster] = true;
            keep_skew_part(&mut self.C, |k| mechanism.cluster_of_velocity(k) == cluster);
        }
    }
}

/// `A ← ½ (A − Aᵀ)` for the velocities of a cluster.
fn keep_skew_part(A: &mut DMatrix<f64>, is_own: impl Fn(usize) -> bool) {
    for k in (0..A.ncols()).filter(|k| is_own(*k)) {
        for i in (0..=k).filter(|i| is_own(*i)) {
            let half = 0.5 * (A[(i, k)] - A[(k, i)]);
            A[(i, k)] = half;
            A[(k, i)] = -half;
        }
    }
}

/// Solves `A x = b` in place of b, by elimination without exchanges. Returns a cluster of which a
/// pivot is not positive, unless it is `forced`.
///
/// A has the sparsity of M. Elimination from the leaves to the base preserves it: each velocity
/// changes only the rows and columns of its path.
fn eliminate(model: &Model, A: &mut DMatrix<f64>, b: &mut [f64], forced: &[bool]) -> Option<usize> {
    let n = b.len();
    let A = A.as_mut_slice();
    for k in (0..n).rev() {
        let (before, own) = A.split_at_mut(k * n);
        let pivot = own[k];
        let cluster = model.mechanism().cluster_of_velocity(k);
        if !forced[cluster] && (pivot.is_nan() || pivot <= 0.0) {
            return Some(cluster);
        }
        let path = model.velocity_path(k);
        let path = &path[..path.len() - 1];
        let (base, joints) = path.split_at(model.lead(model.body_of_velocity(k)).min(path.len()));
        let base_rows = base
            .first()
            .map_or(0..0, |&first| first..first + base.len());
        let subtract = |x: &mut [f64], factor: f64| {
            for (x, y) in x[base_rows.clone()].iter_mut().zip(&own[base_rows.clone()]) {
                *x -= factor * y;
            }
            for &i in joints {
                x[i] -= factor * own[i];
            }
        };
        for column in (base.iter().chain(joints)).map(|j| j * n) {
            let factor = before[column + k] / pivot;
            subtract(&mut before[column..column + n], factor);
        }
        let factor = b[k] / pivot;
        subtract(b, factor);
    }
    for k in 0..n {
        let path = model.velocity_path(k);
        let known: f64 = (path[..path.len() - 1].iter())
            .map(|&j| A[j * n + k] * b[j])
            .sum();
        b[k] = (b[k] - known) / A[k * n + k];
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::Configuration;

    #[test]
    fn elimination_along_the_paths_solves_what_the_dense_matrix_multiplies() {
        let model = Model::rover();
        let mut q = Configuration::zero(&model);
        let v: Vec<f64> = (0..model.nv()).map(|k| (1.7 * k as f64).sin()).collect();
        q.advance(&model, &v, 1.0);
        let kinematics = Kinematics::of(&model, &q);
        let mut C = DMatrix::zeros(model.nv(), model.nv());
        coriolis_matrix(
            &model,
            &kinematics,
            &v,
            &mut CoriolisScratch::default(),
            &mut C,
        );
        let M = kinematics.mass_matrix(&model);
        let A = &M + C * 0.01;
        let mut x = DVector::from_column_slice(&v);
        let pivot = eliminate(&model, &mut A.clone(), x.as_mut_slice(), &[false]);
        assert_eq!(pivot, None);
        assert!((A * x - DVector::from_column_slice(&v)).norm() < 1e-12);
        let mut turned_round = -M;
        let mut x = v;
        let pivot = eliminate(&model, &mut turned_round, &mut x, &[false]);
        assert_eq!(pivot, Some(0));
    }
}
