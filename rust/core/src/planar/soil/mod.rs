//! Granular soil in the plane: the disks of [`crate::system::grains`], and a machine that drives over them.
//!
//! [`crate::simulation::grains`] takes them through time.
//!
//! - [`machine`]: a planar machine among disks; [`rig`]: one wheel at a given slip, for the drawbar pull.

pub mod machine;
pub mod rig;

pub use crate::system::grains::{
    GrainError as SoilError, GrainFriction as SoilFriction, GrainKey as SoilKey, SleepOptions,
};
pub use machine::on_soil;
pub use rig::WheelRig;

use crate::system::grains;

/// The disks.
pub type Disks = grains::Grains<2>;
/// Where they start.
pub type Packing = grains::Packing<2>;
/// What holds them.
pub type Wall = grains::Wall<2>;
/// What drives on them.
pub type Machine = dyn grains::Machine<2>;
/// A soil's description.
pub type SoilScene = grains::GrainScene<2>;
/// A contact of a disk or a wheel.
pub type SoilContact = grains::GrainContact<2>;
/// Scratch of a soil.
pub type SoilParts = grains::GrainParts<2>;
/// A soil in a step.
pub type SoilSystem<'a> = grains::GrainSystem<'a, 2>;
