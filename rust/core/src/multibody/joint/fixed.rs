//! Fixed joint: no motion at all.
//!
//! A body fixed to another one, and one whose joint is locked, is part of it: masses and shapes are
//! merged and no coordinate is left. A root that is fixed stands in the world.

use nalgebra::{Matrix3, Vector3};

use super::JointAxis;

/// A joint held for good at one value of its coordinate: rad about, or m along, its axis.
#[derive(Clone, Copy, Debug)]
pub enum Lock {
    /// The frames coincide but for the joint's own place and rotation.
    AtZero,
    /// Turned by an angle.
    Turned(JointAxis, f64),
    /// Displaced.
    Displaced(JointAxis, f64),
}

impl Lock {
    /// Displacement and rotation of the locked body's frame, in the frame that `R` maps to.
    #[must_use]
    pub fn place(&self, R: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        match self {
            Self::AtZero => (Vector3::zeros(), *R),
            Self::Turned(axis, angle) => (Vector3::zeros(), axis.rotate(R, *angle).0),
            Self::Displaced(axis, way) => (axis.turned(R) * *way, *R),
        }
    }
}
