//! The coordinates that users and references see, and the state behind them; 21 for the rover.
//!
//! One number per velocity, in the order of the velocities (nv). A free body has its position and
//! three angles, a revolute or prismatic joint its coordinate, a spherical joint three angles of
//! the body relative to the joint's frame.
//!
//! Public `q`: the angles are roll, heading, pitch with `R = Ry(heading) Rz(pitch) Rx(roll)`.
//! Report `q`: Cardan angles about x, y, z with `R = Rz(q5) Ry(q4) Rx(q3)` (the numbers are a
//! rover's), and velocity `qdot = dq/dt`, so that `v = B(q) qdot` with B the identity but for the
//! blocks of the angles.

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use super::error::StateError;
use super::joint::JointModel;
use super::model::Model;
use super::state::{Configuration, components, rotation_of};
use crate::scalar::elementary::sin_cos;
use crate::spatial::{CardanReport, HeadingPitchRoll};

/// Checks that there are `expected` finite entries.
pub(crate) fn check(
    field: &'static str,
    values: &[f64],
    expected: usize,
) -> Result<(), StateError> {
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

/// The configuration at coordinates (nv), where `turn` maps three angles to a rotation.
fn from_angles(
    model: &Model,
    q: &[f64],
    turn: impl Fn([f64; 3]) -> UnitQuaternion<f64>,
) -> Result<Configuration, StateError> {
    check("q", q, model.nv())?;
    let mut configuration = Configuration::zero(model);
    for (own, &k) in (configuration.joints.iter_mut()).zip(model.joint_velocities()) {
        *own = q[k];
    }
    for (joint, k) in model.rotating_joints() {
        let turn = |angles| components(&turn(angles));
        joint.set_public(&q[*k..], turn, &mut configuration);
    }
    Ok(configuration)
}

/// Writes the coordinates (nv) of a configuration, where `angles` maps a rotation to three angles.
fn write_angles(
    model: &Model,
    configuration: &Configuration,
    angles: impl Fn(&Matrix3<f64>) -> [f64; 3],
    q: &mut [f64],
) {
    for (own, &k) in configuration.joints.iter().zip(model.joint_velocities()) {
        q[k] = *own;
    }
    for (joint, k) in model.rotating_joints() {
        let angles = |own| angles(rotation_of(own).to_rotation_matrix().matrix());
        joint.write_public(configuration, angles, &mut q[*k..]);
    }
}

/// Coordinates (nv) of a configuration, where `angles` maps a rotation to three angles.
fn to_angles(
    model: &Model,
    configuration: &Configuration,
    angles: impl Fn(&Matrix3<f64>) -> [f64; 3],
) -> Vec<f64> {
    let mut q = vec![0.0; model.nv()];
    write_angles(model, configuration, angles, &mut q);
    q
}

/// Configuration of public coordinates (nv).
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn from_public(model: &Model, q: &[f64]) -> Result<Configuration, StateError> {
    from_angles(model, q, |[roll, heading, pitch]| {
        let angles = HeadingPitchRoll {
            heading,
            pitch,
            roll,
        };
        angles.to_quaternion()
    })
}

/// Public coordinates (nv) of a configuration.
#[must_use]
pub fn to_public(model: &Model, configuration: &Configuration) -> Vec<f64> {
    to_angles(model, configuration, public_angles)
}

/// Writes the public coordinates (nv) of a configuration.
///
/// # Panics
/// If `q` is shorter than nv.
pub fn write_public(model: &Model, configuration: &Configuration, q: &mut [f64]) {
    write_angles(model, configuration, public_angles, q);
}

fn public_angles(R: &Matrix3<f64>) -> [f64; 3] {
    let angles = HeadingPitchRoll::from_rotation(R);
    [angles.roll, angles.heading, angles.pitch]
}

/// Configuration of the report's coordinates (nv).
///
/// # Errors
/// Wrong length, or an entry that is not finite.
pub fn from_report(model: &Model, q: &[f64]) -> Result<Configuration, StateError> {
    from_angles(model, q, |[x, y, z]| {
        CardanReport { x, y, z }.to_quaternion()
    })
}

/// Positions of the angles among the coordinates, and their values.
#[derive(Clone, Debug)]
pub struct ReportAngles {
    blocks: Vec<(usize, CardanReport)>,
}

/// The Cardan angles in report coordinates (nv).
#[must_use]
pub fn report_angles(model: &Model, q: &[f64]) -> ReportAngles {
    let blocks = angular_blocks(model).map(|k| {
        let [x, y, z] = [q[k], q[k + 1], q[k + 2]];
        (k, CardanReport { x, y, z })
    });
    ReportAngles {
        blocks: blocks.collect(),
    }
}

/// First index of the angles, and of the angular velocity, of each rotation.
pub(crate) fn angular_blocks(model: &Model) -> impl Iterator<Item = usize> + '_ {
    let joints = model.rotating_joints().iter();
    joints.filter_map(|(joint, k)| joint.first_angle().map(|at| k + at))
}

/// The world axes about which the three public angles of a rotation turn it, as columns.
pub(crate) fn axes_of_angles([_, heading, pitch]: [f64; 3]) -> Matrix3<f64> {
    let ((sin_h, cos_h), (sin_p, cos_p)) = (sin_cos(heading), sin_cos(pitch));
    let of_roll = Vector3::new(cos_h * cos_p, sin_p, -sin_h * cos_p);
    let of_pitch = Vector3::new(sin_h, 0.0, cos_h);
    Matrix3::from_columns(&[of_roll, Vector3::y(), of_pitch])
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
    for (k, angles) in report_angles(model, q).blocks {
        let omega = angles.rate_matrix() * Vector3::new(qdot[k], qdot[k + 1], qdot[k + 2]);
        v[k..k + 3].copy_from_slice(omega.as_slice());
    }
    Ok(v)
}

/// Report coordinates and rates of a configuration and a velocity.
///
/// # Errors
/// `SingularCardan` where a heading is ±90 degrees and the rates do not exist.
pub fn to_report(
    model: &Model,
    configuration: &Configuration,
    v: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), StateError> {
    let q = to_angles(model, configuration, |R| {
        let angles = CardanReport::from_rotation(R);
        [angles.x, angles.y, angles.z]
    });
    let mut qdot = v.to_vec();
    for (k, angles) in report_angles(model, &q).blocks {
        let E = angles.rate_matrix();
        let inverse = (sin_cos(angles.y).1.abs() > 1e-9)
            .then(|| E.try_inverse())
            .flatten();
        let Some(inverse) = inverse else {
            return Err(StateError::SingularCardan {
                index: k + 1,
                heading: angles.y,
            });
        };
        let rates = inverse * Vector3::new(v[k], v[k + 1], v[k + 2]);
        qdot[k..k + 3].copy_from_slice(rates.as_slice());
    }
    Ok((q, qdot))
}

/// `Bᵀ A B`: a symmetric operator on velocities, in the report's coordinates.
#[must_use]
pub fn congruence(A: &DMatrix<f64>, angles: &ReportAngles) -> DMatrix<f64> {
    let mut out = A.clone();
    for &(k, angles) in &angles.blocks {
        let E = angles.rate_matrix();
        let columns = out.fixed_columns::<3>(k) * E;
        out.fixed_columns_mut::<3>(k).copy_from(&columns);
        let rows = E.transpose() * out.fixed_rows::<3>(k);
        out.fixed_rows_mut::<3>(k).copy_from(&rows);
    }
    out
}

/// `Bᵀ f`: a generalized force, in the report's coordinates.
#[must_use]
pub fn pull_back(f: &DVector<f64>, angles: &ReportAngles) -> DVector<f64> {
    angles.rate_operator(f.nrows()).transpose() * f
}

/// `Ḃ qdot`: what the report's coordinates add to the acceleration, `v̇ = B q̈ + Ḃ q̇`.
#[must_use]
pub fn rate_drift(angles: &ReportAngles, qdot: &[f64]) -> DVector<f64> {
    let mut drift = DVector::zeros(qdot.len());
    for &(k, angles) in &angles.blocks {
        let rates = Vector3::new(qdot[k], qdot[k + 1], qdot[k + 2]);
        drift
            .rows_mut(k, 3)
            .copy_from(&angles.rate_matrix_derivative_times_rates(&rates));
    }
    drift
}

impl ReportAngles {
    /// `B` (nv, nv): identity but for the angular blocks `E`.
    #[must_use]
    pub fn rate_operator(&self, nv: usize) -> DMatrix<f64> {
        let mut B = DMatrix::identity(nv, nv);
        for &(k, angles) in &self.blocks {
            B.view_mut((k, k), (3, 3)).copy_from(&angles.rate_matrix());
        }
        B
    }
}
