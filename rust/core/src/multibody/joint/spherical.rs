//! Spherical joint: any rotation about a point.
//!
//! Its velocity is the angular velocity relative to the carrier, in the axes of the joint's frame,
//! which the carrier takes along. The motions of the three velocities are then turns about axes
//! fixed in the carrier, as a revolute joint's is.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::Motion;
use crate::spatial::exp_rotation;

/// Number of velocities.
pub const NV: usize = 3;

/// A spherical joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spherical {
    /// Its number in [`Configuration::rotations`](crate::multibody::Configuration::rotations).
    pub rotation: usize,
}

impl Spherical {
    /// The motions of its velocities, about the axes of the joint's frame `R` through `place`.
    #[must_use]
    pub fn motions(R: &Matrix3<f64>, place: &Vector3<f64>) -> [Motion; NV] {
        std::array::from_fn(|i| Motion::turn(R.column(i).into(), *place))
    }

    /// A rotation after `h` seconds at the velocity `v` (3), along the exponential map.
    ///
    /// The velocity is in the carrier's axes, so the turn multiplies from the left.
    #[must_use]
    pub fn moved(rotation: &UnitQuaternion<f64>, v: &[f64], h: f64) -> UnitQuaternion<f64> {
        exp_rotation(&(Vector3::new(v[0], v[1], v[2]) * h)) * rotation
    }
}
