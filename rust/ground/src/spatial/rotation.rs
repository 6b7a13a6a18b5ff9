//! Attitude: the exponential map and the two angle triples that users see.
//!
//! The state carries a unit quaternion `R_WB`, so no step meets a singularity. Angles serve users
//! and the comparison with the references:
//!
//! - public `q`: `R = Ry(heading) Rz(pitch) Rx(roll)`, singular only with the nose straight up;
//! - report: `R = Rz(q5) Ry(q4) Rx(q3)`, singular at a heading of 90 degrees.

use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};

use crate::spatial::quaternion;
use friction_contact::scalar::elementary::{atan2, hypot, sin_cos};

/// Rotation by the vector `phi` (rad, world axes): the quaternion `exp(phi / 2)`.
#[must_use]
pub fn exp_rotation(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let [x, y, z, w] = quaternion::exp_rotation::<f64>((*phi).into());
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}

/// Matrix of the rotation by an angle (rad) about an axis.
#[must_use]
pub fn rotation_about(axis: &Unit<Vector3<f64>>, angle: f64) -> Matrix3<f64> {
    let (sin, cos) = sin_cos(angle);
    let [x, y, z]: [f64; 3] = axis.into_inner().into();
    let rest = 1.0 - cos;
    Matrix3::new(
        cos + x * x * rest,
        x * y * rest - z * sin,
        x * z * rest + y * sin,
        x * y * rest + z * sin,
        cos + y * y * rest,
        y * z * rest - x * sin,
        x * z * rest - y * sin,
        y * z * rest + x * sin,
        cos + z * z * rest,
    )
}

/// Quaternion of the rotation by an angle (rad) about an axis.
#[must_use]
pub fn quaternion_about(axis: &Unit<Vector3<f64>>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = sin_cos(0.5 * angle);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, axis.into_inner() * sin))
}

/// Heading, pitch and roll (rad) of the public coordinates: `R = Ry(heading) Rz(pitch) Rx(roll)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingPitchRoll {
    /// About the vertical y, positive to the left.
    pub heading: f64,
    /// About z, positive with the nose up.
    pub pitch: f64,
    /// About x, positive with the right side down.
    pub roll: f64,
}

impl HeadingPitchRoll {
    /// Angles of an attitude. With the nose straight up or down the heading is taken as 0.
    #[must_use]
    pub fn from_rotation(R: &Matrix3<f64>) -> Self {
        let horizontal = hypot(R[(0, 0)], R[(2, 0)]);
        let pitch = atan2(R[(1, 0)], horizontal);
        if horizontal < 1e-9 {
            let roll = atan2(R[(2, 1)], R[(2, 2)]);
            return Self {
                heading: 0.0,
                pitch,
                roll,
            };
        }
        Self {
            heading: atan2(-R[(2, 0)], R[(0, 0)]),
            pitch,
            roll: atan2(-R[(1, 2)], R[(1, 1)]),
        }
    }

    /// The attitude `R_WB` of these angles.
    #[must_use]
    pub fn to_quaternion(self) -> UnitQuaternion<f64> {
        quaternion_about(&Vector3::y_axis(), self.heading)
            * quaternion_about(&Vector3::z_axis(), self.pitch)
            * quaternion_about(&Vector3::x_axis(), self.roll)
    }
}

/// Cardan angles of the report about x, y, z (rad): `R = Rz(z) Ry(y) Rx(x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CardanReport {
    /// `q3`, about x.
    pub x: f64,
    /// `q4`, about y: the heading, where the triple is singular at ±90 degrees.
    pub y: f64,
    /// `q5`, about z.
    pub z: f64,
}

impl CardanReport {
    /// Angles of an attitude. At the singular heading the angle about z is taken as 0.
    #[must_use]
    pub fn from_rotation(R: &Matrix3<f64>) -> Self {
        let across = hypot(R[(0, 0)], R[(1, 0)]);
        let y = atan2(-R[(2, 0)], across);
        if across < 1e-9 {
            let x = atan2(-R[(1, 2)], R[(1, 1)]);
            return Self { x, y, z: 0.0 };
        }
        Self {
            x: atan2(R[(2, 1)], R[(2, 2)]),
            y,
            z: atan2(R[(1, 0)], R[(0, 0)]),
        }
    }

    /// The attitude `R_WB` of these angles.
    #[must_use]
    pub fn to_quaternion(self) -> UnitQuaternion<f64> {
        quaternion_about(&Vector3::z_axis(), self.z)
            * quaternion_about(&Vector3::y_axis(), self.y)
            * quaternion_about(&Vector3::x_axis(), self.x)
    }

    /// `E` in `ω = E (ẋ, ẏ, ż)`: Cardan rates to world angular velocity.
    #[must_use]
    pub fn rate_matrix(self) -> Matrix3<f64> {
        let Rz = rotation_about(&Vector3::z_axis(), self.z);
        let Ry = rotation_about(&Vector3::y_axis(), self.y);
        Matrix3::from_columns(&[Rz * (Ry * Vector3::x()), Rz * Vector3::y(), Vector3::z()])
    }

    /// `dE/dt (ẋ, ẏ, ż)`: the part of the angular acceleration that is quadratic in the rates.
    #[must_use]
    pub fn rate_matrix_derivative_times_rates(self, rates: &Vector3<f64>) -> Vector3<f64> {
        let E = self.rate_matrix();
        // Each column turns with the angles to its left: d/dt(Rz Ry x) = (ż z + ẏ Rz y) × column,
        // ...
        let w_z = Vector3::z() * rates.z;
        let w_zy = w_z + E.column(1) * rates.y;
        w_zy.cross(&(E.column(0) * rates.x)) + w_z.cross(&(E.column(1) * rates.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix(q: UnitQuaternion<f64>) -> Matrix3<f64> {
        *q.to_rotation_matrix().matrix()
    }

    proptest! {
        #[test]
        fn exponential_agrees_with_axis_angle(x in -3.0..3.0, y in -3.0..3.0, z in -3.0..3.0, scale in -12.0..0.0f64) {
            let phi = Vector3::new(x, y, z) * scale.exp2();
            let expected = UnitQuaternion::from_scaled_axis(phi);
            prop_assert!((exp_rotation(&phi).coords - expected.coords).norm() < 1e-15);
        }

        #[test]
        fn angles_return_the_attitude(a in -3.1..3.1, b in -1.5..1.5, c in -3.1..3.1) {
            let hpr = HeadingPitchRoll { heading: a, pitch: b, roll: c };
            let R = matrix(hpr.to_quaternion());
            prop_assert!((matrix(HeadingPitchRoll::from_rotation(&R).to_quaternion()) - R).norm() < 1e-12);
            let cardan = CardanReport { x: a, y: b, z: c };
            let R = matrix(cardan.to_quaternion());
            prop_assert!((matrix(CardanReport::from_rotation(&R).to_quaternion()) - R).norm() < 1e-12);
        }

        #[test]
        fn rate_matrix_is_the_derivative_of_the_attitude(a in -3.0..3.0, b in -1.4..1.4, c in -3.0..3.0, da in -1.0..1.0, db in -1.0..1.0, dc in -1.0..1.0) {
            let at = |t: f64| CardanReport { x: a + t * da, y: b + t * db, z: c + t * dc };
            let rates = Vector3::new(da, db, dc);
            let h = 1e-5;
            let dR = (matrix(at(h).to_quaternion()) - matrix(at(-h).to_quaternion())) / (2.0 * h);
            let w = at(0.0).rate_matrix() * rates;
            prop_assert!((dR - w.cross_matrix() * matrix(at(0.0).to_quaternion())).norm() < 1e-8);
            let dw = (at(h).rate_matrix() - at(-h).rate_matrix()) * rates / (2.0 * h);
            prop_assert!((dw - at(0.0).rate_matrix_derivative_times_rates(&rates)).norm() < 1e-8);
        }
    }

    #[test]
    fn nose_straight_up_keeps_the_attitude() {
        for pitch in [std::f64::consts::FRAC_PI_2, -std::f64::consts::FRAC_PI_2] {
            let R = matrix(
                HeadingPitchRoll {
                    heading: 0.3,
                    pitch,
                    roll: 0.4,
                }
                .to_quaternion(),
            );
            let again = matrix(HeadingPitchRoll::from_rotation(&R).to_quaternion());
            assert!((R - again).norm() < 1e-8);
            let R = matrix(
                CardanReport {
                    x: 0.3,
                    y: pitch,
                    z: 0.4,
                }
                .to_quaternion(),
            );
            let again = matrix(CardanReport::from_rotation(&R).to_quaternion());
            assert!((R - again).norm() < 1e-8);
        }
    }
}
