//! Prismatic joint: translation along an axis fixed in parent and child.
//!
//! Coordinate and velocity are the displacement and its rate; the screw is the axis. A limit acts
//! as a force along it.

use super::axis::JointAxis;
use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3};

/// A prismatic joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prismatic {
    /// Axis of the joint, the same in the joint's frame and the body's.
    pub axis: JointAxis,
    /// Index of its displacement (m) in
    /// [`Configuration::joints`](crate::multibody::Configuration::joints).
    pub coordinate: usize,
}

impl Prismatic {
    /// Displaces its body by a length, m.
    #[inline(always)]
    pub(super) fn displace<T: Lane>(&self, frame: &Mat3<T>, way: T) -> JointPlacement<T> {
        JointPlacement {
            R: *frame,
            shift: Some(self.axis.turned(frame) * way),
        }
    }
}

impl JointModel for Prismatic {
    fn slides(&self) -> bool {
        true
    }

    fn coordinate(&self) -> Option<usize> {
        Some(self.coordinate)
    }

    fn axis(&self) -> Option<&JointAxis> {
        Some(&self.axis)
    }

    #[inline(always)]
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        q: &impl JointCoordinates<T>,
        _turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        self.displace(frame, q.number_at(self.coordinate))
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, frame: &Mat3<T>, mut set: impl FnMut(usize, Screw<T>)) {
        set(0, Screw::slide(self.axis.turned(frame)));
    }

    #[inline(always)]
    fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T> {
        Screw::slide(motion.swing)
    }
}
