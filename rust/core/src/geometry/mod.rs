//! The ground: primitives, and terrains that say which of them a thing can touch.

pub mod error;
pub mod plane;
pub mod terrain;

pub use error::TerrainError;
pub use plane::Plane;
pub use terrain::{Primitive, Terrain};
