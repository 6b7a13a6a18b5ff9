//! A ground of any shape under a round body.
//!
//! [`terrain`]: the rover's terrains; [`drum`], [`silo`]: vessels.

pub mod drum;
pub mod silo;
pub mod terrain;

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::SVector;

pub use drum::Drum;
pub use silo::{Floor, Silo};
pub use terrain::TerrainSupport;

/// A point of the ground that faces the centre of a round body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing<const D: usize> {
    /// The point, m.
    pub foot: SVector<f64, D>,
    /// Unit normal, out of the ground.
    pub n: SVector<f64, D>,
    /// Signed distance of the centre from the ground along n, m; negative inside.
    pub distance: f64,
}

/// A ground that carries round bodies. Immutable, shared between threads.
pub trait Support<const D: usize>: Debug + Send + Sync {
    /// Appends the points that face `centre` within `reach` (m), in an order that does not change
    /// under small motions.
    ///
    /// Each is a local minimum of the distance. From inside the ground only the nearest of all
    /// counts, at any depth.
    fn facing(&self, centre: &SVector<f64, D>, reach: f64, out: &mut Vec<Facing<D>>);

    /// Velocity of its surface at one of these points, m/s. Its shape does not change.
    fn velocity(&self, _at: &Facing<D>) -> SVector<f64, D> {
        SVector::zeros()
    }

    /// Angular velocity of what has this point, rad/s; about the viewer's axis in the plane.
    fn spin(&self, _at: &Facing<D>) -> [f64; 3] {
        [0.0; 3]
    }

    /// No point of its surface is faster, m/s.
    fn fastest(&self) -> f64 {
        0.0
    }
}

/// `Arc`s of supports are supports, so that scenes can share them.
impl<const D: usize, S: Support<D> + ?Sized> Support<D> for Arc<S> {
    fn facing(&self, centre: &SVector<f64, D>, reach: f64, out: &mut Vec<Facing<D>>) {
        (**self).facing(centre, reach, out);
    }

    fn velocity(&self, at: &Facing<D>) -> SVector<f64, D> {
        (**self).velocity(at)
    }

    fn spin(&self, at: &Facing<D>) -> [f64; 3] {
        (**self).spin(at)
    }

    fn fastest(&self) -> f64 {
        (**self).fastest()
    }
}
