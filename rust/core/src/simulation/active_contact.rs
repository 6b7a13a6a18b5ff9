//! The contacts of the last step with their impulses and velocities, in the plane and in space.

use std::fmt::Debug;

use serde::{Deserialize, Serialize};

use crate::integrator::UnilateralContact;

/// A contact with a place in the world.
pub trait LocatedContact: UnilateralContact + Copy + PartialEq + Debug {
    /// Unit normal, world, out of the second body or the ground.
    fn normal(&self) -> Self::Local;

    /// Whether every number of it is finite.
    fn is_finite(&self) -> bool;
}

/// A contact of the last step with its impulse and velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "C: Serialize, C::Local: Serialize",
    deserialize = "C: Deserialize<'de>, C::Local: Deserialize<'de>"
))]
pub struct ActiveContact<C: LocatedContact> {
    /// Key, frame and gap, where the step evaluated them.
    pub contact: C,
    /// Place of the contact, world, m.
    pub position: C::Local,
    /// Impulse along the normal and the tangents, N s.
    pub impulse: C::Local,
    /// Local velocity after the step along the normal and the tangents, m/s.
    pub velocity: C::Local,
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
