//! Poses and velocities of a machine's bodies, however they are kept.

use nalgebra::{Matrix3, Vector3};

use crate::multibody::{Kinematics, Model};

/// A machine at one instant, as the detection of its contacts needs it.
pub(crate) trait BodyMotion {
    /// Origin of a body's tree, world, m.
    fn origin(&self, body: usize) -> Vector3<f64>;

    /// Attitude of a body, and its origin relative to that of its tree, m.
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>);

    /// Velocity (m/s) of a body's material point at `x`, relative to the origin of its tree.
    fn point_velocity(&self, body: usize, x: &Vector3<f64>) -> Vector3<f64>;
}

/// A machine by its kinematics and its velocity (nv).
#[derive(Clone, Copy)]
pub(crate) struct Still<'a> {
    pub model: &'a Model,
    pub kinematics: &'a Kinematics,
    pub v: &'a [f64],
}

impl BodyMotion for Still<'_> {
    #[inline]
    fn origin(&self, body: usize) -> Vector3<f64> {
        *self.kinematics.origin(body)
    }

    #[inline]
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        (self.kinematics.R(body), self.kinematics.r(body))
    }

    #[inline]
    fn point_velocity(&self, body: usize, x: &Vector3<f64>) -> Vector3<f64> {
        (self.kinematics).point_velocity(self.model, body, x, self.v)
    }
}
