//! Gyroscopic terms taken implicitly: the free change of velocity with the Coriolis matrix inside the balance.
//!
//! ```text
//! (M̂ + θ h C) Δv = h (τ − G − C v) + J
//! ```
//!
//! C is frozen, `C = C(q_m, v_m)`. Its skew part does no work and rotates the velocity by a Cayley transform, whatever the spin. Its symmetric
//! part `½ Ṁ` can make the matrix singular where a frame turns by radians in a step; there it is left out, and what the poses at both ends
//! make of the energy is the audit's ([`super::energy_audit`]).

use nalgebra::{DMatrix, DVector, Vector3};

use crate::multibody::coriolis::{CoriolisScratch, coriolis_matrix};
use crate::multibody::{Kinematics, MassMatrix, Model};

/// Scratch, filled at the first step that needs it.
#[derive(Clone, Debug, Default)]
pub(super) struct GyroscopicScratch {
    coriolis: CoriolisScratch,
    C: DMatrix<f64>,
    matrix: DMatrix<f64>,
    change: Vec<f64>,
}

/// `out = −G` (nv), N and N m: what gravity does.
pub(super) fn gravity_load(
    model: &Model,
    kinematics: &Kinematics,
    gravity: &Vector3<f64>,
    out: &mut [f64],
) {
    let bodies = model.bodies();
    out.fill(0.0);
    for (b, body) in bodies.iter().enumerate() {
        let weight = gravity * body.mass;
        let moment = kinematics.c[b].cross(&weight);
        for k in 0..3 {
            out[k] += weight[k];
            out[3 + k] += moment[k];
        }
        for &k in &model.path(b)[6..] {
            let (axis, place) = (&kinematics.axis[k - 5], &kinematics.r[k - 5]);
            out[k] += axis.dot(&(moment - place.cross(&weight)));
        }
    }
}

impl GyroscopicScratch {
    /// Turns the impulse `y = h (τ − G)` (nv) into `M̂ Δv − J`, see the page above.
    ///
    /// `mass_matrix` is M̂; `v` the velocity before the step and the one at which C is frozen; `impulse` is J (nv).
    #[allow(clippy::too_many_arguments)] // the letters of the formula
    pub(super) fn solve(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        mass_matrix: &MassMatrix,
        (h, theta): (f64, f64),
        (v, v_frozen): (&[f64], &[f64]),
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let nv = model.nv();
        if self.C.nrows() != nv {
            self.C = DMatrix::zeros(nv, nv);
        }
        coriolis_matrix(model, kinematics, v_frozen, &mut self.coriolis, &mut self.C);
        let v = DVector::from_column_slice(v);
        for is_skew in [false, true] {
            if is_skew {
                self.C = (&self.C - self.C.transpose()) * 0.5;
            }
            self.matrix = mass_matrix.to_dense(model) + &self.C * (theta * h);
            let load = DVector::from_column_slice(y) + DVector::from_column_slice(impulse)
                - &self.C * &v * h;
            // Of a matrix whose symmetric part is positive definite every pivot is positive without exchanges.
            if let Some(change) = eliminate(&mut self.matrix, load, is_skew) {
                self.change.resize(nv, 0.0);
                mass_matrix.times(model, change.as_slice(), &mut self.change);
                for ((y, change), impulse) in y.iter_mut().zip(&self.change).zip(impulse) {
                    *y = change - impulse;
                }
                return;
            }
        }
    }
}

/// Solves by elimination without exchanges; none where a pivot is not positive, unless `is_forced`.
fn eliminate(A: &mut DMatrix<f64>, mut b: DVector<f64>, is_forced: bool) -> Option<DVector<f64>> {
    let n = b.len();
    for k in 0..n {
        let pivot = A[(k, k)];
        if !is_forced && (pivot.is_nan() || pivot <= 0.0) {
            return None;
        }
        for i in k + 1..n {
            let factor = A[(i, k)] / pivot;
            if factor != 0.0 {
                for j in k + 1..n {
                    A[(i, j)] -= factor * A[(k, j)];
                }
                b[i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| A[(k, j)] * b[j]).sum();
        b[k] = (b[k] - known) / A[(k, k)];
    }
    Some(b)
}
