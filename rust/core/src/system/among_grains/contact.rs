//! The contacts of a tree among balls, and their keys.

use serde::{Deserialize, Serialize};

use crate::contact::{Contact, ContactKey};
use crate::integrator::UnilateralContact;
use crate::system::grains::{GrainContact, GrainKey};

/// A contact of a part of the tree with a grain. Its normal points from the grain to the part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrainTouch {
    /// Key among all contacts of grains: the part, as the number of grains plus its code, then the
    /// grain.
    pub key: GrainKey,
    /// The touch as a contact of the tree.
    pub contact: Contact,
    /// Gap at the start of the step, m.
    pub gap_start: f64,
}

impl GrainTouch {
    /// The grain's number.
    #[must_use]
    pub fn grain(&self) -> u32 {
        self.key.b
    }

    /// The grain, and how high above its surface the part's point is, m.
    pub(super) fn pushed(&self) -> (u32, f64) {
        (self.grain(), self.gap_start)
    }
}

/// A contact of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CompositeContact {
    /// Contact of a grain with anything but the tree.
    Grains(GrainContact<3>),
    /// Contact of the tree with anything but a grain.
    Tree(Contact),
    /// Contact of the tree with a grain.
    Touch(GrainTouch),
}

/// Key of a contact, in the order of the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CompositeKey {
    /// Key of a grain's contact with anything but the tree.
    Grains(GrainKey),
    /// Key of the tree's contact with anything but a grain.
    Tree(ContactKey),
    /// Key of a contact of the tree with a grain.
    Touch(GrainKey),
}

impl UnilateralContact for CompositeContact {
    type Key = CompositeKey;
    type Local = [f64; 3];

    fn key(&self) -> CompositeKey {
        match self {
            Self::Grains(contact) => CompositeKey::Grains(contact.key),
            Self::Tree(contact) => CompositeKey::Tree(contact.key),
            Self::Touch(touch) => CompositeKey::Touch(touch.key),
        }
    }

    fn gap(&self) -> f64 {
        match self {
            Self::Grains(contact) => contact.gap,
            Self::Tree(contact) => contact.gap,
            Self::Touch(touch) => touch.contact.gap,
        }
    }
}
