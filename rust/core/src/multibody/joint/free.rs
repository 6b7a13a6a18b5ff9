//! Free joint: a root with six degrees of freedom.
//!
//! Its velocity is the linear velocity of its frame's origin and its angular velocity, both in
//! world axes. Positions in its tree are relative to its origin, so a machine far from the world's
//! origin loses no precision.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::spatial::exp_rotation;

/// Number of velocities.
pub const NV: usize = 6;

/// A free joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Free {
    /// Index of its pose in the configuration:
    /// [`Configuration::pose`](crate::multibody::Configuration::pose).
    pub pose: usize,
}

/// Position and attitude of a free body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of its frame in the world, m.
    pub position: Vector3<f64>,
    /// Attitude `R_WB`.
    pub attitude: UnitQuaternion<f64>,
}

impl Default for Pose {
    fn default() -> Self {
        Self {
            position: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
        }
    }
}

impl Pose {
    /// The pose after `h` seconds at velocity `v` (6), along the exponential map.
    ///
    /// The angular velocity is in world axes, so the increment multiplies from the left.
    #[must_use]
    pub fn moved(&self, v: &[f64], h: f64) -> Self {
        let turn = exp_rotation(&(Vector3::new(v[3], v[4], v[5]) * h));
        Self {
            position: self.position + Vector3::new(v[0], v[1], v[2]) * h,
            attitude: turn * self.attitude,
        }
    }
}
