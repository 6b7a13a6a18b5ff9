//! A unilateral contact: a part of a body against the ground or against a part of another body, or
//! a joint against its stop.
//!
//! The normal points *to* the contact's own part: from the ground to the machine, or from the other
//! body. Between two bodies the contact point lies halfway between the surfaces and is the same for
//! both, so the impulse conserves their total linear and angular momentum. The surface points lie
//! along the normal, so the gap rate equals the normal relative velocity at the common point.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::frame::ContactFrame;
use super::part::Part;
use crate::geometry::Terrain;
use crate::law::materials::Materials;
use crate::multibody::Model;

/// Opposite side of a contact, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Opposite {
    /// A primitive of the ground.
    Ground(u32),
    /// A part of another body, by its [`Part::code`].
    Part(u16),
    /// A grain, by its number.
    Grain(u32),
    /// None: a joint's stop ([`super::limit`]) and its dry friction ([`super::joint_friction`])
    /// have no shape.
    Stop,
}

/// Identifies a contact from one step to the next: both sides, and the point of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ContactKey {
    /// [`Part::code`] of the part.
    pub part: u16,
    /// On the ground, the rim point or corner, with [`ON_SURFACE`] on a surface; on a sphere of the
    /// ground, 0 for the nearest point and 1 for a part that passes the sphere within one step.
    /// Between bodies, the feature of [`crate::geometry::query::PairPoint`]. For a joint, 0 is the
    /// lower stop, 1 the upper and 2 its friction.
    pub feature: u32,
    /// Opposite side of the contact.
    pub opposite: Opposite,
}

/// Marks the features of contacts with a face, an edge or a vertex of a surface.
pub const ON_SURFACE: usize = 0x100;

/// Number of all surfaces in [`ContactKey::lasting`].
pub const ANY_PIECE: u32 = u32::MAX;

impl ContactKey {
    /// The key by which the next step knows the contact: on a surface the same for all pieces, so
    /// that a wheel which rolls over an inner edge keeps its contact.
    #[inline]
    #[must_use]
    pub fn lasting(self) -> Self {
        match self.opposite {
            // The features of pairs are counted otherwise: the bit says nothing there.
            Opposite::Ground(_) if self.feature as usize & ON_SURFACE != 0 => Self {
                opposite: Opposite::Ground(ANY_PIECE),
                ..self
            },
            _ => self,
        }
    }

    /// Key of a part's feature on a primitive of the ground.
    ///
    /// # Panics
    /// If a part has more than 2^32 features.
    #[inline]
    #[must_use]
    pub fn on_ground(part: Part, feature: usize, primitive: u32) -> Self {
        Self {
            part: part.code(),
            feature: narrow(feature),
            opposite: Opposite::Ground(primitive),
        }
    }

    /// Key with its feature marked as one on a surface, by [`ON_SURFACE`].
    #[inline]
    #[must_use]
    pub fn on_surface(self) -> Self {
        Self {
            feature: self.feature | narrow(ON_SURFACE),
            ..self
        }
    }

    /// Key of a part's feature on a grain.
    ///
    /// # Panics
    /// If a part has more than 2^32 features.
    #[must_use]
    pub fn on_grain(part: Part, feature: usize, grain: u32) -> Self {
        Self {
            part: part.code(),
            feature: narrow(feature),
            opposite: Opposite::Grain(grain),
        }
    }

    /// Key of a feature of two parts.
    ///
    /// # Panics
    /// If a pair has more than 2^32 features.
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

/// The clusters of a model that a contact touches, by its key: the same one twice where it touches
/// no other.
pub(crate) fn clusters_of(model: &Model, key: &ContactKey) -> [usize; 2] {
    let of = |code| (model.mechanism()).cluster_of_body(Part::body_of_code(code, model));
    let own = of(key.part);
    match key.opposite {
        Opposite::Part(other) => [own, of(other)],
        Opposite::Ground(_) | Opposite::Grain(_) | Opposite::Stop => [own, own],
    }
}

#[inline]
fn narrow(feature: usize) -> u32 {
    u32::try_from(feature).unwrap_or_else(|_| panic!("invariant: feature {feature} fits 32 bits"))
}

/// Second body of a contact between two bodies, and its part in contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherSide {
    /// Part of the second body that is in contact.
    pub part: Part,
    /// Body that carries it.
    pub body: usize,
}

/// A possible contact point of a body with the ground or another body, or a joint's stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Identity of the contact from step to step.
    pub key: ContactKey,
    /// The part in contact.
    pub part: Part,
    /// Body that carries the part.
    pub body: usize,
    /// Second body of the model in contact; `None` for the ground, a grain or a joint's stop.
    pub other: Option<OtherSide>,
    /// Contact point relative to the origin of the body's tree, world axes, m: on the ground the
    /// body's own point, between bodies the midpoint.
    pub point: Vector3<f64>,
    /// Contact frame; its normal points to the part.
    pub frame: ContactFrame,
    /// Signed distance, m, positive when separated.
    pub gap: f64,
    /// Depth behind a piece of a surface that is no way out, and that the gap leaves out, m.
    pub excess: f64,
}

impl Contact {
    /// μ and e where its two materials have a law of their own.
    #[must_use]
    pub fn between_materials(
        &self,
        model: &Model,
        terrain: &dyn Terrain,
        materials: &Materials,
    ) -> Option<[f64; 2]> {
        let own = self.part.material(model);
        let opposite = match (self.key.opposite, self.other) {
            (Opposite::Ground(primitive), _) => terrain.material(primitive),
            (Opposite::Part(_), Some(other)) => other.part.material(model),
            (Opposite::Part(_), None) | (Opposite::Grain(_) | Opposite::Stop, _) => return None,
        };
        materials.between(own, opposite)
    }
}
