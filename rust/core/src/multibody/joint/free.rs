//! Free joint: a root with six degrees of freedom.
//!
//! Its velocity is the linear velocity of its frame's origin and its angular velocity, both in
//! world axes. Positions in its tree are relative to its origin, so a machine far from the world's
//! origin loses no precision. Its six screws are the units of these axes; the mass matrix has them
//! as a block of its own, so they are not among the tree's motions. The rotations are about the
//! body's own origin.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3, Vec3};
use crate::spatial::quaternion::{exp_rotation, product, rotation};

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
pub struct FreePose {
    /// Origin of its frame in the world, m.
    pub position: Vector3<f64>,
    /// Attitude `R_WB`.
    pub attitude: UnitQuaternion<f64>,
}

impl Default for FreePose {
    fn default() -> Self {
        Self {
            position: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
        }
    }
}

impl JointModel for Free {
    fn nv(&self) -> usize {
        NV
    }

    fn n_motions(&self) -> usize {
        0
    }

    fn turning(&self) -> Option<f64> {
        Some(1.0)
    }

    #[inline(always)]
    fn place<T: Lane>(
        &self,
        _frame: &Mat3<T>,
        q: &impl JointCoordinates<T>,
        _turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        JointPlacement {
            R: rotation(&q.pose_at(self.pose).1),
            shift: None,
        }
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, _frame: &Mat3<T>, _set: impl FnMut(usize, Screw<T>)) {}

    #[inline(always)]
    fn screw<T: Lane>(&self, _motion: &Motion<T>) -> Screw<T> {
        Screw::NONE
    }

    #[inline(always)]
    fn advance<T: Lane>(&self, q: &mut impl JointCoordinates<T>, v: &[T], h: T) {
        let (position, attitude) = q.pose_at(self.pose);
        q.set_pose_at(self.pose, moved((&position, &attitude), v, h));
    }

    fn names(&self) -> &'static [&'static str] {
        &["x", "y", "z", "roll", "heading", "pitch"]
    }

    fn first_angle(&self) -> Option<usize> {
        Some(3)
    }

    fn set_public(
        &self,
        public: &[f64],
        turn: impl Fn([f64; 3]) -> [f64; 4],
        q: &mut impl JointCoordinates<f64>,
    ) {
        let position = Vec3::new(public[0], public[1], public[2]);
        q.set_pose_at(
            self.pose,
            (position, turn([public[3], public[4], public[5]])),
        );
    }

    fn write_public(
        &self,
        q: &impl JointCoordinates<f64>,
        angles: impl Fn([f64; 4]) -> [f64; 3],
        public: &mut [f64],
    ) {
        let (Vec3 { x, y, z }, attitude) = q.pose_at(self.pose);
        public[..3].copy_from_slice(&[x, y, z]);
        public[3..NV].copy_from_slice(&angles(attitude));
    }
}

/// Position and attitude after `h` seconds at the velocity `v` (6), along the exponential map.
///
/// The angular velocity is in world axes, so the increment multiplies from the left.
#[inline(always)]
pub fn moved<T: Lane>(
    (position, attitude): (&Vec3<T>, &[T; 4]),
    v: &[T],
    h: T,
) -> (Vec3<T>, [T; 4]) {
    let Motion { axis, swing } = velocity(v);
    let turn = exp_rotation(axis * h);
    (*position + swing * h, product(&turn, attitude))
}

/// The velocity `v` (6) as a motion: of its angular velocity and of its origin.
#[inline(always)]
pub fn velocity<T: Lane>(v: &[T]) -> Motion<T> {
    let v = &v[..NV];
    Motion {
        axis: Vec3::new(v[3], v[4], v[5]),
        swing: Vec3::new(v[0], v[1], v[2]),
    }
}
