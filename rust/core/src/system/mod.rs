//! Mechanical systems, advanced by the time-stepping schemes of [`crate::integrator`].
//!
//! - [`tree`]: a multibody tree on a terrain, under a [`command`];
//! - [`planar`]: a planar machine on a ground;
//! - [`composite`]: two systems as one, with contacts between them;
//!   [`among_grains`]: those of a tree and balls;
//! - [`gyroscopic`]: implicit gyroscopic terms of the tree; `motor_branch`: the branch of a motor's
//!   torque–speed line in a step, implicit with [`fitted_theta`];
//! - [`grains`]: thousands of free disks or balls, and a machine among
//!   them; [`soil`]: disks under a planar machine.

pub mod among_grains;
pub mod command;
pub mod composite;
pub mod fitted_theta;
pub mod grains;
pub mod gyroscopic;
pub(crate) mod motor_branch;
pub mod planar;
mod sand;
mod sand_patch;
pub mod soil;
pub mod tree;

pub use among_grains::{AmongGrains, AmongParts, GrainTouch};
pub use command::{Command, Drive, HeldJoint};
pub use composite::{Apart, Composite, CompositeParts, Coupling, Of, PartsOf};
pub use planar::{PlanarContact, PlanarKey, PlanarScratch, PlanarSystem, contact_rows};
pub use tree::{DriveAction, TreeScratch, TreeSystem};
