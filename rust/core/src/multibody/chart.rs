//! The equations of motion in the coordinates that users choose: the state's or the report's.

use nalgebra::{DMatrix, DVector, Vector3};

use super::coordinates::{
    checked_velocity, congruence, from_public, from_report, pull_back, rate_drift, report_angles,
    velocity_from_report,
};
use super::error::StateError;
use super::kinematics::Kinematics;
use super::model::Model;
use super::state::Configuration;

/// A set of coordinates and velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chart {
    /// Public `q` and the velocity `v` of the state.
    State,
    /// The report's Cardan angles and their rates.
    Report,
}

impl Chart {
    /// Configuration of coordinates (nv).
    ///
    /// # Errors
    /// Wrong length, or an entry that is not finite.
    pub fn configuration(self, model: &Model, q: &[f64]) -> Result<Configuration, StateError> {
        match self {
            Self::State => from_public(model, q),
            Self::Report => from_report(model, q),
        }
    }

    /// Velocity `v` (nv) of rates in this chart.
    ///
    /// # Errors
    /// Wrong length, or an entry that is not finite.
    pub fn velocity(self, model: &Model, q: &[f64], qdot: &[f64]) -> Result<Vec<f64>, StateError> {
        match self {
            Self::State => checked_velocity(model, qdot),
            Self::Report => velocity_from_report(model, q, qdot),
        }
    }

    /// A generalized force, or a row of a Jacobian, in this chart: `f` or `Bᵀ f`.
    #[must_use]
    pub fn covector(self, model: &Model, q: &[f64], f: DVector<f64>) -> DVector<f64> {
        match self {
            Self::State => f,
            Self::Report => pull_back(&f, &report_angles(model, q)),
        }
    }

    /// Mass matrix `M` or `Bᵀ M B`; `kinematics` at the coordinates `q`.
    #[must_use]
    pub fn mass_matrix(self, model: &Model, q: &[f64], kinematics: &Kinematics) -> DMatrix<f64> {
        let M = kinematics.mass_matrix(model);
        match self {
            Self::State => M,
            Self::Report => congruence(&M, &report_angles(model, q)),
        }
    }

    /// Bias `b` of `M v̇ + b = τ`, or `Bᵀ (b + M Ḃ q̇)`; `kinematics` at the coordinates `q`.
    ///
    /// `gravity`: m/s², world.
    ///
    /// # Errors
    /// Wrong length of `qdot`, or an entry that is not finite.
    pub fn bias(
        self,
        model: &Model,
        (q, qdot): (&[f64], &[f64]),
        kinematics: &Kinematics,
        gravity: &Vector3<f64>,
    ) -> Result<DVector<f64>, StateError> {
        let v = self.velocity(model, q, qdot)?;
        let bias = DVector::from_vec(kinematics.bias(model, &v, gravity));
        Ok(match self {
            Self::State => bias,
            Self::Report => {
                let angles = report_angles(model, q);
                let drift = kinematics.mass_matrix(model) * rate_drift(&angles, qdot);
                pull_back(&(bias + drift), &angles)
            }
        })
    }
}

/// Maps torques to generalized forces (nv, 2 `n_wheels`): a column for each wheel's torque,
/// positive forward, then one for each steering torque.
#[must_use]
pub fn actuation_matrix(model: &Model) -> DMatrix<f64> {
    let wheels = model.wheels();
    let mut T = DMatrix::zeros(model.nv(), 2 * wheels.len());
    for (i, wheel) in wheels.iter().enumerate() {
        if let Some(j) = wheel.joint {
            T[(model.joint_velocity(j), i)] = wheel.drive_sign;
        }
        if let Some(j) = wheel.steering {
            T[(model.joint_velocity(j), wheels.len() + i)] = 1.0;
        }
    }
    T
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The power of a force, `f · v = (Bᵀ f) · q̇`, and the energy are the same in both charts.
    #[test]
    fn power_and_energy_are_the_same_in_both_charts() {
        let model = Model::rover();
        let nv = model.nv();
        let of = |scale: f64| {
            (0..nv)
                .map(|k| scale * (k as f64 - 4.0))
                .collect::<Vec<_>>()
        };
        let (q, rates) = (of(0.05), of(0.3));
        let configuration = Chart::Report.configuration(&model, &q).unwrap();
        let kinematics = Kinematics::of(&model, &configuration);
        let v = DVector::from_vec(Chart::Report.velocity(&model, &q, &rates).unwrap());
        let rates = DVector::from_vec(rates);
        let f = DVector::from_vec(of(1.7));
        let pulled = Chart::Report.covector(&model, &q, f.clone());
        assert!((f.dot(&v) - pulled.dot(&rates)).abs() < 1e-12 * f.norm() * v.norm());
        let M = Chart::State.mass_matrix(&model, &q, &kinematics);
        let own = Chart::Report.mass_matrix(&model, &q, &kinematics);
        let energy = v.dot(&(M * &v));
        assert!((energy - rates.dot(&(own * &rates))).abs() < 1e-12 * energy);
    }
}
