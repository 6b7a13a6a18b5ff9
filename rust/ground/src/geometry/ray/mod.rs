//! What a ray meets first: the query behind depth images and laser scans.
//!
//! | | method |
//! |---|---|
//! | plane, sphere, box, disc | closed form: [`plane`], [`sphere`], [`oriented_box`], [`disc`] |
//! | ellipsoid, polytope | closed form: [`ellipsoid`], [`hull`] |
//! | wheel with a width, cylinder, capsule | Newton's method on a convex distance: [`roller`] |
//! | many spheres | descent of the ball tree, near halves first |
//! | height field | walk from cell to cell, past tiles that lie below the ray: [`height_field`] |
//! | mesh | descent of a tree of boxes, near ones first: [`triangle`] |
//!
//! A surface is met from either side, so a ray that starts in the ground meets the surface where
//! it leaves. Neighbouring triangles leave no gap between them.
//!
//! [`mod@cast`] answers for many rays at once.

pub mod cast;
pub mod disc;
pub mod ellipsoid;
pub mod error;
pub mod height_field;
pub mod hull;
pub mod oriented_box;
pub mod plane;
pub mod roller;
pub mod shape;
pub mod sphere;
pub mod triangle;

use nalgebra::Vector3;

pub use cast::{cast, check_rays};
pub use error::RayError;

/// Components of a unit direction below this are zero, so that their inverses stay finite.
const SMALLEST: f64 = 1e-150;

/// A half-line in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// World, m.
    pub origin: Vector3<f64>,
    /// Unit.
    pub direction: Vector3<f64>,
}

impl Ray {
    /// From a place (world, m) along a direction of any length; `None` for one that is zero.
    #[must_use]
    pub fn new(origin: Vector3<f64>, direction: Vector3<f64>) -> Option<Self> {
        // Divided by the largest entry first, whose square may overflow or vanish.
        let largest = direction.amax();
        let unit = (largest > 0.0).then(|| (direction / largest).normalize())?;
        Some(Self {
            origin,
            direction: unit.map(|d| if d.abs() < SMALLEST { 0.0 } else { d }),
        })
    }

    /// The inverse of each component of the direction, finite where a component is zero.
    #[inline]
    #[must_use]
    pub fn inverse(&self) -> Vector3<f64> {
        let inverse = |d: f64| 1.0 / d.abs().max(SMALLEST).copysign(d);
        self.direction.map(inverse)
    }

    /// The place at a distance (m), world, m.
    #[inline]
    #[must_use]
    pub fn at(&self, distance: f64) -> Vector3<f64> {
        self.origin + self.direction * distance
    }
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// From the ray's origin, m.
    pub distance: f64,
    /// Unit normal of the surface, out of what it bounds.
    pub normal: Vector3<f64>,
}

/// The nearer of two.
#[inline]
#[must_use]
pub fn nearer(first: Option<Hit>, second: Option<Hit>) -> Option<Hit> {
    match (first, second) {
        (Some(a), Some(b)) => Some(if b.distance < a.distance { b } else { a }),
        (a, b) => a.or(b),
    }
}
