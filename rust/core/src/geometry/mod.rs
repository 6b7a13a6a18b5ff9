//! Shapes, the ground, and the distances between them. This chapter knows no machine.
//!
//! - [`shape`]: shapes of parts; [`terrain`]: grounds;
//! - [`broad_phase`]: search for nearby things; [`query`]: distance, points and normal of a pair,
//!   one module per pair of shapes;
//! - [`ray`]: what a ray meets first;
//! - [`support`]: a ground of any shape under a round body, in the plane or in space.

pub mod broad_phase;
pub mod query;
pub mod ray;
pub mod shape;
pub mod support;
pub mod terrain;

pub use ray::{Hit, Ray, RayError};
pub use shape::{Disc, OrientedBox, PlacedShape, Roller, Sphere, SupportMap};
pub use support::{Drum, Facing, Floor, Silo, Support, TerrainSupport};
pub use terrain::{
    Clearing, Coverage, HeightField, Neighbourhood, Plane, Primitive, Rocks, SoftGround, SoftLayer,
    SphereField, Tangent, Terrain, TerrainError, TriangleMesh, Union,
};
