//! The ground: what a terrain must answer, and the terrains there are.
//!
//! A terrain says which of its primitives can be touched near a place. Each primitive is convex and
//! pairs with every shape of a machine ([`super::query`]).

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
    /// Visits every primitive that comes closer than `reach` (m) to `centre`
    /// (world, m), with a number that names it for as long as the terrain lives.
    /// May visit others too; must not depend on those far away.
    fn visit_near(&self, centre: &Vector3<f64>, reach: f64, visit: &mut dyn FnMut(u32, &Primitive));

    /// Whether a part can be past a primitive after one step: a ball, but no half-space. Only then
    /// is the motion within a step looked at.
    fn can_be_passed(&self) -> bool {
        true
    }

    /// The primitive of a number that [`Self::visit_near`] gave.
    fn primitive(&self, id: u32) -> Primitive;

    /// Height y (m) of the visible surface at (x, z); `None` where there is none.
    fn height(&self, x: f64, z: f64) -> Option<f64>;

    /// The plane that everything else lies on, if there is one.
    fn ground(&self) -> Option<&Plane>;
}
