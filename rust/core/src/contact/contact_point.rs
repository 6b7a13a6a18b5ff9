//! One unilateral contact between a body and a piece of ground.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::contact_frame::ContactFrame;

/// What of the machine touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Part {
    /// A wheel, by its index.
    Wheel(usize),
    /// A box, by its index in the model.
    Box(usize),
}

/// Names a contact from one step to the next: part, feature of the part, primitive of the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ContactKey {
    /// Wheels count from 0, boxes from 2^15.
    pub part: u16,
    /// Rim point or corner; on a sphere 0, or 1 where it is met and passed in one step.
    pub feature: u16,
    /// The ground's number of the primitive.
    pub primitive: u32,
}

impl ContactKey {
    /// Key of a part's feature on a primitive.
    ///
    /// # Panics
    /// If a model has more than 2^15 wheels or boxes, or a part more than 2^16 features.
    #[must_use]
    pub fn new(part: Part, feature: usize, primitive: u32) -> Self {
        let narrow = |x: usize| {
            u16::try_from(x)
                .unwrap_or_else(|_| panic!("invariant: {x} parts or features fit 16 bits"))
        };
        let part = match part {
            Part::Wheel(i) => narrow(i),
            Part::Box(i) => narrow(i) | 0x8000,
        };
        Self {
            part,
            feature: narrow(feature),
            primitive,
        }
    }
}

/// A point where a body can touch the ground.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Its name from step to step.
    pub key: ContactKey,
    /// What touches.
    pub part: Part,
    /// Body that carries the point.
    pub body: usize,
    /// The point of the body, relative to the trunk origin, world axes, m.
    pub point: Vector3<f64>,
    /// Frame of the contact.
    pub frame: ContactFrame,
    /// Signed distance, m, positive when apart.
    pub gap: f64,
}
