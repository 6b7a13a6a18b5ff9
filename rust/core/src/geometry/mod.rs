//! The ground: primitives, and terrains that say which of them a thing can touch; [`support`]: a ground of any shape, as a round body in the
//! plane or in space meets it.

pub mod ball_tree;
pub mod error;
pub mod plane;
pub mod rocks;
pub mod sphere;
pub mod sphere_field;
pub mod support;
pub mod terrain;

pub use error::TerrainError;
pub use plane::Plane;
pub use rocks::{Clearing, Rocks};
pub use sphere::Sphere;
pub use sphere_field::SphereField;
pub use support::{Facing, Support};
pub use terrain::{Primitive, Terrain};
