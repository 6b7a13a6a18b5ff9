//! Fixed joint: no relative motion.
//!
//! A solid that is fixed to a body, or whose joint is locked, becomes part of that body: masses and
//! shapes are merged and the coordinate disappears. A fixed root is attached to the world.

use nalgebra::{Matrix3, Vector3};

use super::axis::JointAxis;
use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::screw::{Motion, Screw};
use crate::scalar::elementary::sin_cos;
use crate::scalar::{Lane, Mat3};

/// A fixed joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fixed;

impl JointModel for Fixed {
    #[inline(always)]
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        _q: &impl JointCoordinates<T>,
        _turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        JointPlacement {
            R: *frame,
            shift: None,
        }
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, _frame: &Mat3<T>, _set: impl FnMut(usize, Screw<T>)) {}

    #[inline(always)]
    fn screw<T: Lane>(&self, _motion: &Motion<T>) -> Screw<T> {
        Screw::NONE
    }
}

/// A joint locked at one value of its coordinate: rad about its axis, or m along it.
#[derive(Clone, Copy, Debug)]
pub enum Lock {
    /// The frames coincide, apart from the joint's own position and rotation.
    AtZero,
    /// Rotated by an angle, rad.
    Turned(JointAxis, f64),
    /// Displaced, m.
    Displaced(JointAxis, f64),
}

impl Lock {
    /// Displacement and rotation of the locked body's frame, in the frame that `R` maps to.
    #[must_use]
    pub fn place(&self, R: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        match self {
            Self::AtZero => (Vector3::zeros(), *R),
            Self::Turned(axis, angle) => {
                let frame = Mat3::from(*R);
                let turned = axis.rotate(&frame, axis.turned(&frame), sin_cos(*angle));
                (Vector3::zeros(), turned.into())
            }
            Self::Displaced(axis, way) => (R * axis.direction() * *way, *R),
        }
    }
}
