//! One unilateral contact: a part of a body against the ground, or against a part of another body,
//! or a joint against its stop.
//!
//! The normal points *to* the contact's own part: from the ground to the machine, or from the other
//! body. Between two bodies the contact's point is halfway between the surfaces, one and the same
//! place for both, so that its impulse changes neither the linear nor the angular momentum of the
//! two together; as the surfaces' points lie along the normal the gap's rate is that of the two
//! places all the same.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::frame::ContactFrame;
use super::part::Part;

/// What a contact's part is up against, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Opposite {
    /// A primitive of the ground.
    Ground(u32),
    /// A part of another body, by its [`Part::code`].
    Part(u16),
    /// Nothing that has a shape: a joint's stop ([`super::limit`]).
    Stop,
}

/// Names a contact from one step to the next: both sides, and which point of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ContactKey {
    /// [`Part::code`] of the part.
    pub part: u16,
    /// On the ground a rim point or a corner; on a sphere of the ground 0, or 1 where it is met and
    /// passed in one step. Between bodies the feature of [`crate::geometry::query::PairPoint`]. Of
    /// a joint's stops 0 is the lower one, 1 the upper one.
    pub feature: u16,
    /// The other side.
    pub opposite: Opposite,
}

impl ContactKey {
    /// Key of a part's feature on a primitive of the ground.
    ///
    /// # Panics
    /// If a part has more than 2^16 features.
    #[inline]
    #[must_use]
    pub fn on_ground(part: Part, feature: usize, primitive: u32) -> Self {
        Self {
            part: part.code(),
            feature: narrow(feature),
            opposite: Opposite::Ground(primitive),
        }
    }

    /// Key of a feature of two parts.
    ///
    /// # Panics
    /// If a pair has more than 2^16 features.
    #[inline]
    #[must_use]
    pub fn between(part: Part, feature: usize, other: Part) -> Self {
        Self {
            part: part.code(),
            feature: narrow(feature),
            opposite: Opposite::Part(other.code()),
        }
    }
}

#[inline]
fn narrow(feature: usize) -> u16 {
    u16::try_from(feature).unwrap_or_else(|_| panic!("invariant: feature {feature} fits 16 bits"))
}

/// The other body of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherSide {
    /// What of it touches.
    pub part: Part,
    /// Body that carries it.
    pub body: usize,
}

/// A point where a body can touch the ground or another body, or a joint's stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Its name from step to step.
    pub key: ContactKey,
    /// What touches.
    pub part: Part,
    /// Body that carries the part.
    pub body: usize,
    /// The other body; none where it is the ground or a joint's stop.
    pub other: Option<OtherSide>,
    /// Where, relative to the origin of the body's tree, world axes, m: on the ground the body's
    /// own point, between bodies halfway.
    pub point: Vector3<f64>,
    /// Frame of the contact, its normal towards the part.
    pub frame: ContactFrame,
    /// Signed distance, m, positive when apart.
    pub gap: f64,
}
