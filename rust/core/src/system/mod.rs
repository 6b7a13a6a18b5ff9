//! Mechanical systems: what the time-stepping schemes of [`crate::integrator`] step.
//!
//! - [`tree`]: a tree of solids on a terrain, under a [`command`];
//! - [`planar`]: a planar machine on a ground;
//! - [`composite`]: two systems as one, with contacts between them;
//! - [`gyroscopic`]: its gyroscopic terms, implicit; `motor_branch`: the line that a motor is on in
//!   a step, taken implicitly with [`fitted_theta`];
//! - [`grains`]: thousands of free disks or balls, and a machine among
//!   them; [`soil`]: disks under a planar machine.

pub mod command;
pub mod composite;
pub mod fitted_theta;
pub mod grains;
pub mod gyroscopic;
pub(crate) mod motor_branch;
pub mod planar;
pub mod soil;
pub mod tree;

pub use command::{Command, Drive, HeldJoint};
pub use composite::{Apart, Composite, CompositeParts, Coupling};
pub use planar::{PlanarContact, PlanarKey, PlanarScratch, PlanarSystem, contact_rows};
pub use tree::{DriveAction, TreeScratch, TreeSystem};
