//! Mechanical systems, advanced by the time-stepping schemes of [`crate::integrator`].
//!
//! - [`tree`]: a multibody tree on a terrain, under a [`command`];
//! - `extent`: how far a step turns and displaces it;
//! - [`planar`]: a planar machine on a ground, with its matrices;
//! - [`among_grains`]: a tree among balls;
//! - [`gyroscopic`]: implicit gyroscopic terms of the tree; [`drives`]: its torques, motors and
//!   held joints, implicit with [`fitted_theta`];
//! - [`grains`]: thousands of free disks or balls, and a planar machine among them.

pub mod among_grains;
pub mod command;
pub mod drives;
pub(crate) mod extent;
pub mod fitted_theta;
pub mod grains;
pub mod gyroscopic;
mod momentum_balance;
pub mod planar;
mod planar_matrices;
mod sand;
mod sand_patch;
pub mod tree;
pub mod tree_scratch;

pub use among_grains::{AmongContact, AmongGrains, AmongKey, AmongParts, GrainTouch};
pub use command::{Command, Drive, HeldJoint};
pub use planar::{PlanarContact, PlanarKey, PlanarScratch, PlanarSystem};
pub use tree::TreeSystem;
pub use tree_scratch::TreeScratch;
