//! How a joint velocity moves what the joint carries: as a screw at the body, and as a motion about
//! the tree's origin.

use crate::scalar::{Lane, Vec3};

/// The motion that a unit of a joint velocity imparts to everything the joint carries: a rotation,
/// a translation, or both. World axes, about the tree's origin.
#[derive(Clone, Copy, Debug)]
pub struct Motion<T> {
    /// Angular velocity: the unit axis of a revolute joint, zero of a prismatic one.
    pub axis: Vec3<T>,
    /// Velocity of the material point at the tree's origin: `r × axis` of a revolute joint, the
    /// unit axis of a prismatic one.
    pub swing: Vec3<T>,
}

impl<T: Lane> Motion<T> {
    /// Velocity of the material point at `x`, relative to the tree's origin.
    #[inline(always)]
    pub fn velocity_at(&self, x: Vec3<T>) -> Vec3<T> {
        self.axis.cross(x) + self.swing
    }

    /// Generalized force on its velocity of a force and its moment about the tree's origin.
    #[inline(always)]
    pub fn power(&self, force: Vec3<T>, moment: Vec3<T>) -> T {
        self.axis.dot(moment) + self.swing.dot(force)
    }

    /// `V × S`: the rate of a motion S whose axis is fixed in a body that moves at the velocity V,
    /// this one.
    #[inline(always)]
    #[must_use]
    pub fn rate_of(&self, S: &Self) -> Self {
        Self {
            axis: self.axis.cross(S.axis),
            swing: self.swing.cross(S.axis) + self.axis.cross(S.swing),
        }
    }
}

/// The motion that a unit of a joint velocity imparts to the body that the joint carries, at the
/// origin of that body. World axes. A part that is `None` is zero, and costs nothing.
#[derive(Clone, Copy, Debug)]
pub struct Screw<T> {
    /// Angular velocity relative to the carrier.
    pub turning: Option<Vec3<T>>,
    /// Velocity of the body's origin relative to the carrier.
    pub sliding: Option<Vec3<T>>,
}

impl<T: Lane> Screw<T> {
    /// No motion.
    pub const NONE: Self = Self {
        turning: None,
        sliding: None,
    };

    /// A rotation about an axis through the body's origin.
    #[inline(always)]
    #[must_use]
    pub fn turn(axis: Vec3<T>) -> Self {
        Self {
            turning: Some(axis),
            sliding: None,
        }
    }

    /// A translation along an axis.
    #[inline(always)]
    #[must_use]
    pub fn slide(axis: Vec3<T>) -> Self {
        Self {
            turning: None,
            sliding: Some(axis),
        }
    }

    /// The sum of two.
    #[inline(always)]
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        let sum = |a: Option<Vec3<T>>, b: Option<Vec3<T>>| match (a, b) {
            (Some(a), Some(b)) => Some(a + b),
            (a, b) => a.or(b),
        };
        Self {
            turning: sum(self.turning, other.turning),
            sliding: sum(self.sliding, other.sliding),
        }
    }

    /// At a rate.
    #[inline(always)]
    #[must_use]
    pub fn times(self, rate: T) -> Self {
        Self {
            turning: self.turning.map(|axis| axis * rate),
            sliding: self.sliding.map(|axis| axis * rate),
        }
    }

    /// About the tree's origin, for a body at `r` from it.
    #[inline(always)]
    pub fn motion(&self, r: Vec3<T>) -> Motion<T> {
        let zero = || {
            let zero = r.x.like(0.0);
            Vec3::new(zero, zero, zero)
        };
        let (axis, swing) = match (self.turning, self.sliding) {
            (Some(axis), None) => (axis, r.cross(axis)),
            (None, Some(axis)) => (zero(), axis),
            (Some(axis), Some(slide)) => (axis, r.cross(axis) + slide),
            (None, None) => (zero(), zero()),
        };
        Motion { axis, swing }
    }

    /// Generalized force on its velocity of a force on the body and its moment about the body's
    /// origin.
    #[inline(always)]
    pub fn power(&self, force: Vec3<T>, moment: Vec3<T>) -> T {
        match (self.turning, self.sliding) {
            (Some(axis), None) => axis.dot(moment),
            (None, Some(axis)) => axis.dot(force),
            (Some(axis), Some(slide)) => axis.dot(moment) + slide.dot(force),
            (None, None) => force.x.like(0.0),
        }
    }
}
