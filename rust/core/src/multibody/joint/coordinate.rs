//! The single coordinate of a revolute or prismatic joint.

use super::Coupling;

/// Source of the single coordinate of a revolute or prismatic joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinate {
    /// Index of the joint in [`Configuration::joints`](crate::multibody::Configuration::joints): itself, or
    /// the joint that it follows.
    pub joint: usize,
    /// How it follows that joint; `None` if the coordinate is its own.
    pub coupling: Option<Coupling>,
}

impl Coordinate {
    /// Number of its own velocities.
    #[must_use]
    pub fn nv(&self) -> usize {
        usize::from(self.coupling.is_none())
    }
}
