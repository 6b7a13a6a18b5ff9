//! The 21 numbers that users and references see, and the state behind them.
//!
//! Public `q`: trunk position, then roll, heading, pitch at 3, 4, 5 with `R = Ry(heading) Rz(pitch) Rx(roll)`,
//! then the joints. Report `q`: Cardan angles about x, y, z at 3, 4, 5 with `R = Rz(q5) Ry(q4) Rx(q3)`, and velocity
//! `qdot = dq/dt`, so that `v = B(q) qdot` with B the identity but for the angular block.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::error::StateError;
use super::model::Model;
use super::state::Configuration;
use crate::spatial::{CardanReport, HeadingPitchRoll};

fn check(field: &'static str, values: &[f64], expected: usize) -> Result<(), StateError> {
    if values.len() != expected {
        return Err(StateError::Length {
            field,
            expected,
            actual: values.len(),
        });
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(StateError::NotFinite {
            field,
            index,
            value: values[index],
        }),
        None => Ok(()),
    }
}

/// Configuration of public coordinates (nv).
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn from_public(model: &Model, q: &[f64]) -> Result<Configuration, StateError> {
    check("q", q, model.nv())?;
    let angles = HeadingPitchRoll {
        roll: q[3],
        heading: q[4],
        pitch: q[5],
    };
    Ok(Configuration {
        position: Vector3::new(q[0], q[1], q[2]),
        attitude: angles.to_quaternion(),
        joints: q[6..].to_vec(),
    })
}

/// Public coordinates (nv) of a configuration.
#[must_use]
pub fn to_public(configuration: &Configuration) -> Vec<f64> {
    let angles =
        HeadingPitchRoll::from_rotation(configuration.attitude.to_rotation_matrix().matrix());
    let p = &configuration.position;
    let mut q = vec![p.x, p.y, p.z, angles.roll, angles.heading, angles.pitch];
    q.extend_from_slice(&configuration.joints);
    q
}

/// Configuration of the report's coordinates (nv).
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn from_report(model: &Model, q: &[f64]) -> Result<Configuration, StateError> {
    check("q", q, model.nv())?;
    Ok(Configuration {
        position: Vector3::new(q[0], q[1], q[2]),
        attitude: report_angles(q).to_quaternion(),
        joints: q[6..].to_vec(),
    })
}

/// The Cardan angles in report coordinates.
#[must_use]
pub fn report_angles(q: &[f64]) -> CardanReport {
    CardanReport {
        x: q[3],
        y: q[4],
        z: q[5],
    }
}

/// A checked velocity (nv).
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn checked_velocity(model: &Model, v: &[f64]) -> Result<Vec<f64>, StateError> {
    check("qdot", v, model.nv())?;
    Ok(v.to_vec())
}

/// Velocity `v = B(q) qdot` of the report's rates.
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn velocity_from_report(
    model: &Model,
    q: &[f64],
    qdot: &[f64],
) -> Result<Vec<f64>, StateError> {
    check("q", q, model.nv())?;
    check("qdot", qdot, model.nv())?;
    let mut v = qdot.to_vec();
    let omega = report_angles(q).rate_matrix() * Vector3::new(qdot[3], qdot[4], qdot[5]);
    v[3..6].copy_from_slice(omega.as_slice());
    Ok(v)
}

/// Report coordinates and rates of a configuration and a velocity.
///
/// # Errors
/// `SingularCardan` where the heading is ±90 degrees and the rates do not exist.
pub fn to_report(
    configuration: &Configuration,
    v: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), StateError> {
    let angles = CardanReport::from_rotation(configuration.attitude.to_rotation_matrix().matrix());
    let p = &configuration.position;
    let mut q = vec![p.x, p.y, p.z, angles.x, angles.y, angles.z];
    q.extend_from_slice(&configuration.joints);
    let E = angles.rate_matrix();
    let inverse = (angles.y.cos().abs() > 1e-9)
        .then(|| E.try_inverse())
        .flatten();
    let Some(inverse) = inverse else {
        return Err(StateError::SingularCardan { heading: angles.y });
    };
    let mut qdot = v.to_vec();
    let rates = inverse * Vector3::new(v[3], v[4], v[5]);
    qdot[3..6].copy_from_slice(rates.as_slice());
    Ok((q, qdot))
}

/// `Bᵀ A B`: a symmetric operator on velocities, in the report's coordinates.
#[must_use]
pub fn congruence(A: &DMatrix<f64>, angles: CardanReport) -> DMatrix<f64> {
    let B = rate_operator(A.nrows(), &angles.rate_matrix());
    B.transpose() * A * B
}

/// `Bᵀ f`: a generalized force, in the report's coordinates.
#[must_use]
pub fn pull_back(f: &DVector<f64>, angles: CardanReport) -> DVector<f64> {
    rate_operator(f.nrows(), &angles.rate_matrix()).transpose() * f
}

/// `Ḃ qdot`: what the report's coordinates add to the acceleration, `v̇ = B q̈ + Ḃ q̇`.
#[must_use]
pub fn rate_drift(angles: CardanReport, qdot: &[f64]) -> DVector<f64> {
    let mut drift = DVector::zeros(qdot.len());
    let rates = Vector3::new(qdot[3], qdot[4], qdot[5]);
    drift
        .rows_mut(3, 3)
        .copy_from(&angles.rate_matrix_derivative_times_rates(&rates));
    drift
}

/// `B`: identity but for the angular block `E`.
#[must_use]
pub fn rate_operator(nv: usize, E: &Matrix3<f64>) -> DMatrix<f64> {
    let mut B = DMatrix::identity(nv, nv);
    B.view_mut((3, 3), (3, 3)).copy_from(E);
    B
}
