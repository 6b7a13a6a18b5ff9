//! Spherical joint: arbitrary rotation about a point.
//!
//! Its velocity is the angular velocity relative to the carrier, expressed in the joint's frame,
//! which is fixed in the carrier. The motions of its three velocities are therefore rotations about
//! axes fixed in the carrier, like the motion of a revolute joint.

use nalgebra::{UnitQuaternion, Vector3};

use crate::spatial::exp_rotation;

/// Number of velocities.
pub const NV: usize = 3;

/// A spherical joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spherical {
    /// Its index in [`Configuration::rotations`](crate::multibody::Configuration::rotations).
    pub rotation: usize,
}

impl Spherical {
    /// The rotation after `h` seconds at velocity `v` (3), along the exponential map.
    ///
    /// The velocity is in the carrier's axes, so the increment multiplies from the left.
    #[must_use]
    pub fn moved(rotation: &UnitQuaternion<f64>, v: &[f64], h: f64) -> UnitQuaternion<f64> {
        exp_rotation(&(Vector3::new(v[0], v[1], v[2]) * h)) * rotation
    }
}
