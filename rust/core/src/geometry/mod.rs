//! Shapes, the ground, and the distances between them. Nothing here knows of a machine.
//!
//! - [`shape`]: what parts are made of; [`terrain`]: what the ground is made of;
//! - [`broad_phase`]: what comes near what; [`query`]: distance, points and
//!   normal of a pair, one page a pair of shapes;
//! - [`support`]: a ground of any shape, as a round body in the plane or in space meets it.

pub mod broad_phase;
pub mod query;
pub mod shape;
pub mod support;
pub mod terrain;

pub use shape::{Disc, OrientedBox, PlacedShape, Sphere, SupportMap};
pub use support::{Facing, Support};
pub use terrain::{Clearing, Plane, Primitive, Rocks, SphereField, Terrain, TerrainError};
