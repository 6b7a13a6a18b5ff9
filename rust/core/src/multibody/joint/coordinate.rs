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
    /// Its value, rad or m.
    #[inline]
    #[must_use]
    pub fn of(&self, joints: &[f64]) -> f64 {
        let own = joints[self.joint];
        self.coupling.as_ref().map_or(own, |c| c.value(own))
    }

    /// Its rate, rad/s or m/s, from its own velocity or the one that it follows.
    #[inline]
    #[must_use]
    pub fn rate(&self, v: f64) -> f64 {
        self.coupling.as_ref().map_or(v, |c| c.ratio * v)
    }

    /// Number of its own velocities.
    #[must_use]
    pub fn nv(&self) -> usize {
        usize::from(self.coupling.is_none())
    }
}
