//! Implicit gyroscopic terms: the free change of velocity with the Coriolis matrix in the balance.
//!
//! ```text
//! (M̂ + θ h C) Δv = h (τ − G − C v) + J
//! ```
//!
//! C is frozen, `C = C(q_m, v_m)`. Its skew part does no work and rotates the velocity by a Cayley
//! transform, whatever the spin. Its symmetric part `½ Ṁ` can make the matrix singular if a frame
//! rotates by radians in a step. It is then left out, and the audit
//! ([`crate::integrator::energy_audit`]) corrects the resulting change of the energy.

use nalgebra::{DMatrix, DVector, DVectorView};

use crate::multibody::coriolis::{CoriolisScratch, coriolis_matrix};
use crate::multibody::{Kinematics, MassMatrix, Model};

/// Rotation of a free base in a step, rad, beyond which gyroscopic terms are implicit. At this
/// angle the third-order error of the explicit terms is a thousandth of the energy.
pub(crate) const MOST_TURN: f64 = 0.1;

/// The same limit for the rotation of the fastest frame, joints included, rad. A joint that snaps
/// to a new set-point turns a light part of the machine. Measured on the drives of random policies:
/// implicit terms between this limit and the one above change no error in its third digit.
pub(crate) const MOST_JOINT_TURN: f64 = 0.5;

/// The same limit for the rotation of a wheel about its axle in a step, rad. The spin couples the
/// motions across the axle at a frequency of a few per cent of the spin rate, so explicit terms
/// would stay acceptable up to some twenty times more.
pub(crate) const MOST_SPIN: f64 = 1.0;

/// Whether gyroscopic terms are implicit in a step of h at the velocity `v`.
#[inline]
pub(super) fn is_gyroscopic(model: &Model, h: f64, v: &[f64]) -> bool {
    let base = turning_of_bases(model, v);
    h * base > MOST_TURN
        || h * (base + turning_of_joints(model, v)) > MOST_JOINT_TURN
        || h * fastest(&model.mechanism().spinning, v) > MOST_SPIN
}

/// Upper bound on the angular speed of every frame, rad/s.
#[inline]
pub(super) fn turning(model: &Model, v: &[f64]) -> f64 {
    turning_of_bases(model, v) + turning_of_joints(model, v)
}

/// Largest angular speed of a free base, rad/s.
#[inline]
fn turning_of_bases(model: &Model, v: &[f64]) -> f64 {
    let mut base = 0.0_f64;
    for tree in model.trees() {
        if let [_, _, _, x, y, z, ..] = v[tree.velocities.clone()]
            && tree.is_free
        {
            base = base.max((x * x + y * y + z * z).sqrt());
        }
    }
    base
}

/// Largest rate of a joint that turns a frame, rad/s.
#[inline]
fn turning_of_joints(model: &Model, v: &[f64]) -> f64 {
    let turning = model.mechanism().turning.iter();
    turning.fold(0.0, |most, &(k, ratio)| most.max(v[k].abs() * ratio))
}

/// Largest rate of a set of joints, rad/s.
#[inline]
fn fastest(joints: &[usize], v: &[f64]) -> f64 {
    joints.iter().fold(0.0, |most, &k| most.max(v[k].abs()))
}

/// Scratch, filled at the first step that needs it.
#[derive(Clone, Debug, Default)]
pub(super) struct GyroscopicScratch {
    coriolis: CoriolisScratch,
    C: DMatrix<f64>,
    matrix: DMatrix<f64>,
    /// `h (τ − G − C v) + J`, then Δv.
    load: DVector<f64>,
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
        for is_skew in [false, true] {
            if is_skew {
                keep_skew_part(&mut self.C);
            }
            let C = self.C.as_slice();
            for (entry, c) in self.matrix.as_mut_slice().iter_mut().zip(C) {
                *entry = theta * h * c;
            }
            mass_matrix.add_to_dense(model.mechanism(), 0, &mut self.matrix);
            let load = self.load.as_mut_slice();
            for ((load, y), impulse) in load.iter_mut().zip(&*y).zip(impulse) {
                *load = y + impulse;
            }
            self.load.gemv(-h, &self.C, &v, 1.0);
            // If the symmetric part is positive definite, every pivot is positive without row
            // exchanges.
            let change = self.load.as_mut_slice();
            if eliminate(model, &mut self.matrix, change, is_skew) {
                mass_matrix.times(model.mechanism(), change, y);
                for (y, impulse) in y.iter_mut().zip(impulse) {
                    *y -= impulse;
                }
                return;
            }
        }
    }
}

/// `A ← ½ (A − Aᵀ)`.
fn keep_skew_part(A: &mut DMatrix<f64>) {
    for k in 0..A.ncols() {
        for i in 0..=k {
            let half = 0.5 * (A[(i, k)] - A[(k, i)]);
            A[(i, k)] = half;
            A[(k, i)] = -half;
        }
    }
}

/// Solves `A x = b` in place of b, by elimination without exchanges; false
/// where a pivot is not positive, unless `is_forced`.
///
/// A has the sparsity of M. Elimination from the leaves to the base preserves it: each velocity
/// changes only the rows and columns of its path.
fn eliminate(model: &Model, A: &mut DMatrix<f64>, b: &mut [f64], is_forced: bool) -> bool {
    let n = b.len();
    let A = A.as_mut_slice();
    for k in (0..n).rev() {
        let (before, own) = A.split_at_mut(k * n);
        let pivot = own[k];
        if !is_forced && (pivot.is_nan() || pivot <= 0.0) {
            return false;
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
    true
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
        assert!(eliminate(&model, &mut A.clone(), x.as_mut_slice(), false));
        assert!((A * x - DVector::from_column_slice(&v)).norm() < 1e-12);
        let mut turned_round = -M;
        let mut x = v;
        assert!(!eliminate(&model, &mut turned_round, &mut x, false));
    }
}
