//! Prismatic joint: translation along an axis fixed in parent and child.

use super::{Coordinate, JointAxis};

/// A prismatic joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prismatic {
    /// Its axis, the same in the joint's frame and the body's.
    pub axis: JointAxis,
    /// Displacement, m.
    pub coordinate: Coordinate,
}
