//! Spherical joint: arbitrary rotation about a point.
//!
//! Its coordinate is a unit quaternion, from the body's frame to the joint's. Its velocity is the
//! angular velocity relative to the carrier, expressed in the joint's frame, which is fixed in the
//! carrier. Its three screws are therefore rotations about axes fixed in the carrier, like the
//! screw of a revolute joint. It has no limits.

use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3, Vec3};
use crate::spatial::quaternion::{exp_rotation, product, rotation};

/// A spherical joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spherical {
    /// Index of the joint's rotation in
    /// [`Configuration::rotations`](crate::multibody::Configuration::rotations).
    pub rotation: usize,
}

impl JointModel for Spherical {
    fn nv(&self) -> usize {
        3
    }

    fn turning(&self) -> Option<f64> {
        Some(1.0)
    }

    #[inline(always)]
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        q: &impl JointCoordinates<T>,
        _turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        JointPlacement {
            R: frame.product(&rotation(&q.rotation_at(self.rotation))),
            shift: None,
        }
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, frame: &Mat3<T>, mut set: impl FnMut(usize, Screw<T>)) {
        for (k, axis) in frame.columns().into_iter().enumerate() {
            set(k, Screw::turn(axis));
        }
    }

    #[inline(always)]
    fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T> {
        Screw::turn(motion.axis)
    }

    /// Along the exponential map. The velocity is in the carrier's axes, so the increment
    /// multiplies from the left.
    #[inline(always)]
    fn advance<T: Lane>(&self, q: &mut impl JointCoordinates<T>, v: &[T], h: T) {
        let turn = exp_rotation(Vec3::new(v[0], v[1], v[2]) * h);
        let before = q.rotation_at(self.rotation);
        q.set_rotation_at(self.rotation, product(&turn, &before));
    }

    fn names(&self) -> &'static [&'static str] {
        &["roll", "heading", "pitch"]
    }

    fn first_angle(&self) -> Option<usize> {
        Some(0)
    }

    fn set_public(
        &self,
        public: &[f64],
        turn: impl Fn([f64; 3]) -> [f64; 4],
        q: &mut impl JointCoordinates<f64>,
    ) {
        q.set_rotation_at(self.rotation, turn([public[0], public[1], public[2]]));
    }

    fn write_public(
        &self,
        q: &impl JointCoordinates<f64>,
        angles: impl Fn([f64; 4]) -> [f64; 3],
        public: &mut [f64],
    ) {
        public[..3].copy_from_slice(&angles(q.rotation_at(self.rotation)));
    }
}
