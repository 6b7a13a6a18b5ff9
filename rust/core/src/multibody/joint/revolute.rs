//! Revolute joint: rotation about an axis fixed in parent and child.

use super::{Coordinate, JointAxis};

/// A revolute joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revolute {
    /// Its axis, the same in the joint's frame and the body's.
    pub axis: JointAxis,
    /// Angle, rad.
    pub coordinate: Coordinate,
}
