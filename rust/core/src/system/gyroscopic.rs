//! Implicit gyroscopic terms: the free change of velocity with the Coriolis matrix in the balance.
//!
//! ```text
//! (M̂ + θ h C) Δv = h (τ − G − C v) + J
//! ```
//!
//! C is frozen, `C = C(q_m, v_m)`. Its skew part does no work and rotates the velocity by a Cayley
//! transform, whatever the spin. Its symmetric part `½ Ṁ` can make the matrix singular if a frame
//! rotates by radians in a step. It is then left out for the whole cluster of trees, and the audit
//! (`crate::integrator::audit`) corrects the resulting change of the energy.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::multibody::coriolis::{CoriolisScratch, coriolis_matrix};
use crate::multibody::{Inertias, MassMatrix, Mechanism, Poses};
use crate::scalar::{Lane, LaneMask};

/// Scratch, sized at the first step that needs it. Matrices are stored column after column.
#[derive(Clone, Debug)]
pub(crate) struct Gyroscopic<T: Lane> {
    token: T::Token,
    coriolis: CoriolisScratch<T>,
    C: Vec<T>,
    matrix: Vec<T>,
    /// `h (τ − G − C v) + J`, then Δv.
    load: Vec<T>,
    /// Where the symmetric part of C is left out, for each cluster.
    is_skew: Vec<T::Mask>,
    /// Where a pivot of the last elimination was not positive, for each cluster.
    is_lost: Vec<T::Mask>,
}

/// The machine of a step, at its midpoint.
pub(crate) struct Turned<'a, T: Lane> {
    pub mechanism: &'a Mechanism,
    pub inertias: &'a Inertias<T>,
    pub poses: &'a Poses<T>,
    /// M̂.
    pub mass_matrix: &'a MassMatrix<T>,
}

impl<T: Lane> Gyroscopic<T> {
    /// Without memory.
    pub(crate) fn new(token: T::Token) -> Self {
        Self {
            token,
            coriolis: CoriolisScratch::new(token),
            C: Vec::new(),
            matrix: Vec::new(),
            load: Vec::new(),
            is_skew: Vec::new(),
            is_lost: Vec::new(),
        }
    }

    /// Turns the impulse `y = h (τ − G)` (nv) into `M̂ Δv − J`, see the page above.
    ///
    /// `step`: h and θ; `v`: velocity before the step, and the one at which C is frozen; `impulse`:
    /// J (nv).
    pub(crate) fn solve(
        &mut self,
        of: &Turned<'_, T>,
        step: (T, T),
        [v, v_frozen]: [&[T]; 2],
        impulse: &[T],
        y: &mut [T],
    ) {
        let (mechanism, nv) = (of.mechanism, v.len());
        let (zero, nowhere) = (T::splat(self.token, 0.0), T::mask(self.token, 0));
        for all in [&mut self.C, &mut self.matrix] {
            all.resize(nv * nv, zero);
        }
        self.load.resize(nv, zero);
        for all in [&mut self.is_skew, &mut self.is_lost] {
            all.clear();
            all.resize(mechanism.n_clusters(), nowhere);
        }
        let (coriolis, C) = (&mut self.coriolis, &mut self.C);
        coriolis_matrix(mechanism, of.inertias, of.poses, v_frozen, coriolis, C);
        loop {
            let is_any_lost = T::vectorize(
                self.token,
                #[inline(always)]
                || {
                    self.set_up(of, step, v, impulse, y);
                    self.eliminate(mechanism);
                    self.is_lost.iter().any(|lanes| lanes.any())
                },
            );
            if !is_any_lost {
                break;
            }
            for cluster in 0..self.is_lost.len() {
                let lost = self.is_lost[cluster];
                self.is_skew[cluster] = self.is_skew[cluster] | lost;
                self.is_lost[cluster] = nowhere;
                if lost.any() {
                    keep_skew_part(&mut self.C, nv, lost, |k| {
                        mechanism.cluster_of_velocity(k) == cluster
                    });
                }
            }
        }
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                of.mass_matrix.times(mechanism, &self.load, y);
                for (y, impulse) in y.iter_mut().zip(impulse) {
                    *y -= *impulse;
                }
            },
        );
    }

    /// Matrix and right-hand side.
    #[inline(always)]
    fn set_up(&mut self, of: &Turned<'_, T>, (h, theta): (T, T), v: &[T], impulse: &[T], y: &[T]) {
        let (nv, weight) = (v.len(), theta * h);
        for (entry, c) in self.matrix.iter_mut().zip(&self.C) {
            *entry = weight * *c;
        }
        of.mass_matrix.add_to_full(of.mechanism, &mut self.matrix);
        for (load, (y, impulse)) in self.load.iter_mut().zip(y.iter().zip(impulse)) {
            *load = *y + *impulse;
        }
        for (column, v) in self.C.chunks_exact(nv).zip(v) {
            let turned = h * *v;
            for (load, c) in self.load.iter_mut().zip(column) {
                *load -= turned * *c;
            }
        }
    }

    /// Solves the system in place of the load, by elimination without exchanges; the matrix keeps
    /// the inverses of the pivots. Notes where a
    /// pivot is not positive although the symmetric part of C is there: with a positive definite
    /// symmetric part every pivot is positive.
    ///
    /// The matrix has the sparsity of M. Elimination from the leaves to the base preserves it: each
    /// velocity changes only the rows and columns of its path.
    #[inline(always)]
    fn eliminate(&mut self, mechanism: &Mechanism) {
        let (A, b) = (&mut self.matrix[..], &mut self.load[..]);
        let n = b.len();
        for k in (0..n).rev() {
            let (before, own) = A.split_at_mut(k * n);
            let pivot = own[k];
            let cluster = mechanism.cluster_of_velocity(k);
            let is_lost = !pivot.like(0.0).lt(pivot) & !self.is_skew[cluster];
            self.is_lost[cluster] = self.is_lost[cluster] | is_lost;
            let path = mechanism.velocity_path(k);
            let path = &path[..path.len() - 1];
            let inverse = pivot.like(1.0) / pivot;
            own[k] = inverse;
            for &j in path {
                let factor = before[j * n + k] * inverse;
                for &i in path {
                    before[j * n + i] -= factor * own[i];
                }
            }
            let factor = b[k] * inverse;
            for &i in path {
                b[i] -= factor * own[i];
            }
        }
        for k in 0..n {
            let path = mechanism.velocity_path(k);
            let mut rest = b[k];
            for &j in &path[..path.len() - 1] {
                rest -= A[j * n + k] * b[j];
            }
            b[k] = rest * A[k * n + k];
        }
    }
}

/// `A ← ½ (A − Aᵀ)` of an (n, n) matrix for the velocities of a cluster, in the lanes of a mask.
fn keep_skew_part<T: Lane>(A: &mut [T], n: usize, lanes: T::Mask, is_own: impl Fn(usize) -> bool) {
    for k in (0..n).filter(|k| is_own(*k)) {
        for i in (0..=k).filter(|i| is_own(*i)) {
            let (upper, lower) = (A[k * n + i], A[i * n + k]);
            let half = upper.like(0.5) * (upper - lower);
            A[k * n + i] = T::select(lanes, half, upper);
            A[i * n + k] = T::select(lanes, -half, lower);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::{Configuration, Kinematics, Model};
    use crate::scalar::Single;

    /// `(M̂ + θ h C) Δv` of what is found, and what it should be.
    fn balance(model: &Model, v: &[f64], step: (f64, f64)) -> [Vec<f64>; 2] {
        let mut q = Configuration::zero(model);
        q.advance(model, v, 1.0);
        let (kinematics, token) = (Kinematics::of(model, &q), Single::best());
        let (mechanism, inertias) = (model.mechanism(), model.inertias());
        let mut mass_matrix = MassMatrix::new(token, mechanism);
        mass_matrix.update(mechanism, inertias, kinematics.poses());
        let of = Turned {
            mechanism,
            inertias,
            poses: kinematics.poses(),
            mass_matrix: &mass_matrix,
        };
        let mut solver = Gyroscopic::new(token);
        let impulse: Vec<f64> = v.iter().map(|v| 0.3 + v).collect();
        let mut y: Vec<f64> = v.iter().map(|v| 0.7 * v).collect();
        let right: Vec<f64> = y.iter().zip(&impulse).map(|(y, j)| y + j).collect();
        solver.solve(&of, step, [v, v], &impulse, &mut y);
        let (n, (h, theta)) = (v.len(), step);
        let mut left = vec![0.0; n];
        mass_matrix.times(mechanism, &solver.load, &mut left);
        for k in 0..n {
            for i in 0..n {
                left[i] += h * solver.C[k * n + i] * (theta * solver.load[k] + v[k]);
            }
        }
        [left, right]
    }

    #[test]
    fn the_change_of_velocity_balances_the_step_however_fast_the_machine_turns() {
        let model = Model::rover();
        for speed in [1.0, 100.0, 1e4] {
            let v: Vec<f64> = (0..model.nv())
                .map(|k| speed * (1.7 * k as f64).sin())
                .collect();
            let [left, right] = balance(&model, &v, (0.01, 0.5));
            let size = right.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            for (left, right) in left.iter().zip(&right) {
                let error = (left - right).abs();
                assert!(error < 1e-9 * speed * size, "{speed}: {left} {right}");
            }
        }
    }
}
