//! Granular soil in the plane: the disks of [`super::grains`], and a planar
//! machine that drives over them.

use super::grains;

pub use super::grains::{
    GrainError as SoilError, GrainFriction as SoilFriction, GrainKey as SoilKey, SleepOptions,
};

/// The disks.
pub type Disks = grains::Grains<2>;
/// Where they start.
pub type Packing = grains::Packing<2>;
/// The walls.
pub type Wall = grains::Wall<2>;
/// A soil's description.
pub type SoilScene = grains::GrainScene<2>;
/// A contact of a disk or a wheel.
pub type SoilContact = grains::GrainContact<2>;
/// Scratch of a soil.
pub type SoilParts = grains::GrainParts<2>;
/// A soil in a step.
pub type SoilSystem<'a> = grains::GrainSystem<'a, 2>;
