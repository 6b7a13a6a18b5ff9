//! Poses and velocities of a machine's bodies, however they are kept.

use nalgebra::{Matrix3, Vector3};

use crate::multibody::Motion;
use crate::multibody::mechanism::Mechanism;
use crate::multibody::{Kinematics, Model};

/// A machine at one instant, as its contacts need it.
pub(crate) trait BodyMotion {
    /// The machine.
    fn mechanism(&self) -> &Mechanism;

    /// Origin of a body's tree, world, m.
    fn origin(&self, body: usize) -> Vector3<f64>;

    /// Attitude of a body, and its origin relative to that of its tree, m.
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>);

    /// A joint velocity's motion, by its index.
    fn motion(&self, motion: usize) -> Motion<f64>;

    /// A velocity, m/s or rad/s.
    fn velocity(&self, k: usize) -> f64;

    /// Velocity (m/s) of a body's material point at `x`, relative to the origin of its tree.
    #[inline]
    fn point_velocity(&self, body: usize, x: &Vector3<f64>) -> Vector3<f64> {
        let v = |k| self.velocity(k);
        let velocity = (self.mechanism()).point_velocity(body, (*x).into(), |m| self.motion(m), v);
        velocity.into()
    }
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
    fn mechanism(&self) -> &Mechanism {
        self.model.mechanism()
    }

    #[inline]
    fn origin(&self, body: usize) -> Vector3<f64> {
        *self.kinematics.origin(body)
    }

    #[inline]
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        (self.kinematics.R(body), self.kinematics.r(body))
    }

    #[inline]
    fn motion(&self, motion: usize) -> Motion<f64> {
        self.kinematics.poses().motions[motion]
    }

    #[inline]
    fn velocity(&self, k: usize) -> f64 {
        self.v[k]
    }
}
