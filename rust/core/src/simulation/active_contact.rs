//! The contacts of the last step with their impulses and velocities, in the plane and in space.

use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use crate::integrator::UnilateralContact;

/// Two or three numbers: along a contact's normal and tangents, or along the world's axes.
pub trait Components: Copy + PartialEq + Debug + AsRef<[f64]> {
    /// How many.
    const N: usize;

    /// From a slice of that length.
    fn of(numbers: &[f64]) -> Self;
}

impl<const D: usize> Components for [f64; D] {
    const N: usize = D;

    #[inline]
    fn of(numbers: &[f64]) -> Self {
        let mut own = [0.0; D];
        own.copy_from_slice(numbers);
        own
    }
}

/// A contact with a place in the world.
pub trait LocatedContact: UnilateralContact<Key: Debug> + Copy + PartialEq + Debug {
    /// `[f64; 2]` in the plane, `[f64; 3]` in space.
    type Vector: Components;

    /// Unit normal, world, out of the second body or the ground.
    fn normal(&self) -> Self::Vector;

    /// Whether every number of it is finite.
    fn is_finite(&self) -> bool;
}

/// A contact of the last step with its impulse and velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "C: Serialize, C::Vector: Serialize",
    deserialize = "C: Deserialize<'de>, C::Vector: Deserialize<'de>"
))]
pub struct ActiveContact<C: LocatedContact> {
    /// Key, frame and gap, where the step evaluated them.
    pub contact: C,
    /// Place of the contact, world, m.
    pub position: C::Vector,
    /// Impulse along the normal and the tangents, N s.
    pub impulse: C::Vector,
    /// Local velocity after the step along the normal and the tangents, m/s.
    pub velocity: C::Vector,
}

impl<C: LocatedContact> ActiveContact<C> {
    /// Whether every number of it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let vectors = [&self.position, &self.impulse, &self.velocity];
        let mut numbers = vectors.into_iter().flat_map(AsRef::as_ref);
        self.contact.is_finite() && numbers.all(|x| x.is_finite())
    }
}
