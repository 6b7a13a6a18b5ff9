//! Revolute joint: rotation about an axis fixed in parent and child.
//!
//! Coordinate and velocity are the angle and its rate; the screw is the axis. A limit acts as a
//! moment about it.

use super::axis::JointAxis;
use super::coupling::Coupling;
use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3};

/// A revolute joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revolute {
    /// Axis of the joint, the same in the joint's frame and the body's.
    pub axis: JointAxis,
    /// Index of its angle (rad) in
    /// [`Configuration::joints`](crate::multibody::Configuration::joints).
    pub coordinate: usize,
}

impl JointModel for Revolute {
    fn turning(&self) -> Option<f64> {
        Some(1.0)
    }

    fn coordinate(&self) -> Option<usize> {
        Some(self.coordinate)
    }

    fn angle(&self) -> Option<(usize, Option<Coupling>)> {
        Some((self.coordinate, None))
    }

    fn axis(&self) -> Option<&JointAxis> {
        Some(&self.axis)
    }

    #[inline(always)]
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        _q: &impl JointCoordinates<T>,
        turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        let R = match turn() {
            Some(sin_cos) => self.axis.rotate(frame, self.axis.turned(frame), sin_cos),
            None => *frame,
        };
        JointPlacement { R, shift: None }
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, frame: &Mat3<T>, mut set: impl FnMut(usize, Screw<T>)) {
        set(0, Screw::turn(self.axis.turned(frame)));
    }

    #[inline(always)]
    fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T> {
        Screw::turn(motion.axis)
    }
}
