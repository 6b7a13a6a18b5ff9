//! A multibody tree among balls as one system: block-diagonal M, the contacts of each, and those
//! of the tree's wheels, boxes and balls with the grains.
//!
//! Each side runs its own code, and its coordinates and velocities keep their order: grains, then
//! the tree; so do the contacts: grains, the tree's own, the touches between. With the factors of
//! M̂ = diag(M̂_a, M̂_b)
//!
//! ```text
//! Z = diag(F_a, F_b)⁻ᵀ H,        W = Zᵀ Z.
//! ```
//!
//! The law of a touch is that of the grains ([`super::grains`]): frames are those of the start of
//! the step, and a pair may close by its gap. Both sides are pushed at the same point, that of the
//! part's surface, so the impulses conserve linear and angular momentum, and a wheel that yields
//! rolls on its own radius, as it does on other ground. With touches, all contacts of a step are
//! one problem, solved on the bodies' velocities ([`crate::problem::BodyPairs`]): forces go both
//! ways within the step. Without, each side is solved by its own method and moves as it would
//! alone.
//!
//! Decisions about a whole step apply to both: whether to repeat it, and whether the last step's
//! impulses serve as a forecast. The energy is not audited, as that of grains is not.

pub mod contact;
mod parts;
pub mod system;
mod touches;

pub use contact::{CompositeContact, CompositeKey, GrainTouch};
pub use parts::CompositeScratch;
pub use system::TreeAmongGrains;
