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
use crate::multibody::path_matrix::PathMatrix;
use crate::multibody::{Inertias, MassMatrix, Mechanism, Poses};
use crate::scalar::{Lane, LaneMask, Vec3, inlined};

/// Scratch.
#[derive(Clone, Debug)]
pub(crate) struct Gyroscopic<T: Lane> {
    token: T::Token,
    coriolis: CoriolisScratch<T>,
    C: PathMatrix<T>,
    matrix: PathMatrix<T>,
    /// Bias of gravity.
    weight: Vec<T>,
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
    /// m/s².
    pub gravity: Vec3<T>,
}

impl<T: Lane> Gyroscopic<T> {
    /// Room for a mechanism.
    pub(crate) fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let (zero, nowhere) = (T::splat(token, 0.0), T::mask(token, 0));
        let matrix = PathMatrix::new(token, mechanism);
        Self {
            token,
            coriolis: CoriolisScratch::new(token, mechanism),
            C: matrix.clone(),
            matrix,
            weight: vec![zero; mechanism.nv()],
            load: vec![zero; mechanism.nv()],
            is_skew: vec![nowhere; mechanism.n_clusters()],
            is_lost: vec![nowhere; mechanism.n_clusters()],
        }
    }

    /// Turns the impulse `y = h τ` (nv) into `M̂ Δv − J`, see the page above.
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
        let (token, mechanism) = (self.token, of.mechanism);
        let nowhere = T::mask(token, 0);
        self.is_skew.fill(nowhere);
        coriolis_matrix(
            mechanism,
            (of.inertias, of.poses),
            v_frozen,
            of.gravity,
            &mut self.coriolis,
            (&mut self.C, &mut self.weight),
        );
        loop {
            inlined!(T::vectorize, token, self.set_up(of, step, v, impulse, y));
            self.is_lost.fill(nowhere);
            let (is_lost, is_skew) = (&mut self.is_lost, &self.is_skew);
            let each = |cluster: usize, is_positive: T::Mask| {
                let lost = !is_positive & !is_skew[cluster];
                is_lost[cluster] = is_lost[cluster] | lost;
            };
            (self.matrix).solve(token, mechanism, &mut self.load, each);
            if !self.is_lost.iter().any(|lanes| lanes.any()) {
                break;
            }
            for (cluster, lost) in self.is_lost.iter().enumerate() {
                self.is_skew[cluster] = self.is_skew[cluster] | *lost;
                if lost.any() {
                    self.C.keep_skew_part(mechanism, cluster, *lost);
                }
            }
        }
        inlined!(T::vectorize, token, {
            of.mass_matrix.times(mechanism, &self.load, y);
            for (y, impulse) in y.iter_mut().zip(impulse) {
                *y -= *impulse;
            }
        });
    }

    /// Matrix and right-hand side.
    #[inline(always)]
    fn set_up(&mut self, of: &Turned<'_, T>, (h, theta): (T, T), v: &[T], impulse: &[T], y: &[T]) {
        (of.mass_matrix).add_scaled(theta * h, &self.C, &mut self.matrix);
        self.C.times(of.mechanism, v, &mut self.load);
        let parts = self.weight.iter().zip(y.iter().zip(impulse));
        for (load, (weight, (y, impulse))) in self.load.iter_mut().zip(parts) {
            *load = *y + *impulse - h * (*weight + *load);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

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
            gravity: Vec3::splat(token, [0.3, -9.8, 0.5]),
        };
        let mut solver = Gyroscopic::new(token, mechanism);
        let impulse: Vec<f64> = v.iter().map(|v| 0.3 + v).collect();
        let mut y: Vec<f64> = v.iter().map(|v| 0.7 * v).collect();
        let pushed: Vec<f64> = y.iter().zip(&impulse).map(|(y, j)| y + j).collect();
        solver.solve(&of, step, [v, v], &impulse, &mut y);
        let (n, (h, theta)) = (v.len(), step);
        let weight = kinematics.bias(model, &vec![0.0; n], &Vector3::new(0.3, -9.8, 0.5));
        let right = (pushed.iter().zip(&weight)).map(|(pushed, weight)| pushed - h * weight);
        let right: Vec<f64> = right.collect();
        let mut left = vec![0.0; n];
        mass_matrix.times(mechanism, &solver.load, &mut left);
        let mean: Vec<f64> = (solver.load.iter().zip(v))
            .map(|(change, v)| theta * change + v)
            .collect();
        let mut turned = vec![0.0; n];
        solver.C.times(mechanism, &mean, &mut turned);
        for (left, turned) in left.iter_mut().zip(&turned) {
            *left += h * turned;
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
