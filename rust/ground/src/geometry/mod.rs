//! Shapes, the ground, and the distances between them. This chapter knows no machine.
//!
//! - [`shape`]: shapes of parts; [`terrain`]: grounds;
//! - [`broad_phase`]: search for nearby things; [`query`]: distance, points and normal of a pair,
//!   one module per pair of shapes;
//! - [`ray`]: what a ray meets first; [`picture`]: colour pictures of such rays;
//! - [`support`]: a ground of any shape under a round body, in the plane or in space.
//!
//! # One call
//!
//! A wheel on a terrain, as `rover_core::contact` asks:
//!
//! ```text
//! Terrain::visit_near(place, reach)         broad phase: only primitives that can be in reach
//!    │  Plane, Sphere, Face, Edge, Vertex
//!    ▼
//! query::dispatch::visit_on_plane, ...      one page for each pair of shapes
//!    │
//!    ▼
//! gap, normal, point on both sides          zero or more a pair
//!
//! Terrain::first_hit(ray) ──► ray::{plane, sphere, triangle, ...} ──► the nearest Hit
//! ```
//!
//! # May use
//!
//! [`friction_contact::quantity`], [`friction_contact::scalar`], [`crate::spatial`],
//! [`crate::sand`].
//!
//! From [`crate::sand`] only the numbers of a soil, which a terrain carries, and ruts.

pub mod broad_phase;
pub mod picture;
pub mod query;
pub mod ray;
pub mod shape;
pub mod support;
pub mod terrain;

pub use ray::{Hit, Ray, RayError};
pub use shape::{
    Disc, Ellipsoid, Hull, OrientedBox, PlacedShape, Roller, Roundness, Sphere, SupportMap,
};
pub use support::{Drum, Facing, Floor, Silo, Support, TerrainSupport};
pub use terrain::{
    Clearing, Coverage, HeightField, Neighbourhood, Plane, Primitive, Rocks, SoftGround, SoftLayer,
    SphereField, TangentPlane, Terrain, TerrainError, TriangleMesh, Union,
};
