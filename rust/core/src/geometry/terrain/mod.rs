//! The ground: the interface of a terrain, and the available terrains.
//!
//! A terrain lists its primitives near a place. Each primitive is convex and pairs with every shape
//! of a machine ([`super::query`]).

pub mod error;
pub mod plane;
pub mod rocks;
pub mod sphere_field;

use nalgebra::Vector3;

pub use error::TerrainError;
pub use plane::Plane;
pub use rocks::{Clearing, Rocks};
pub use sphere_field::SphereField;

use super::shape::Sphere;

/// A convex piece of ground whose distance to every shape has a closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// A half-space.
    Plane(Plane),
    /// A ball.
    Sphere(Sphere),
}

/// The ground. Immutable, shared between threads.
pub trait Terrain: Send + Sync {
    /// Visits every primitive that comes closer than `reach` (m) to `centre` (world, m), with a
    /// number that identifies it for the lifetime of the terrain. May visit others too; the result
    /// must not depend on distant ones.
    fn visit_near(&self, centre: &Vector3<f64>, reach: f64, visit: &mut dyn FnMut(u32, &Primitive));

    /// Whether a part can pass a primitive within one step: a ball, but not a half-space. Only then
    /// the motion within a step is examined.
    fn can_be_passed(&self) -> bool {
        true
    }

    /// The primitive with a number from [`Self::visit_near`].
    fn primitive(&self, id: u32) -> Primitive;

    /// Height y (m) of the visible surface at (x, z); `None` where there is none.
    fn height(&self, x: f64, z: f64) -> Option<f64>;

    /// The base plane, if there is one; its number is 0.
    fn ground(&self) -> Option<&Plane>;
}
