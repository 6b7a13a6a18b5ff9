//! Mechanical systems, advanced by the time-stepping schemes of [`crate::integrator`].
//!
//! - [`tree`]: a multibody tree on a terrain, under a [`command`], with its
//!   [scratch](tree_scratch); [`drives`]: torques, motors, held joints, springs and dampers,
//!   implicit with [`fitted_theta`]; `extent`: how far a step turns and displaces it;
//!   `momentum_balance`: the balance of the Newton variant; [`gyroscopic`]: when gyroscopic terms
//!   are implicit, and how; `sand`: its wheels in sand; `sand_patch`, `sand_wheel`,
//!   `sand_tangent`, `six`: one of them; `tree_lanes`: what moves, in the lanes of a scalar;
//! - [`block`]: rovers in the lanes of a register, with their contacts;
//! - `tangent`: derivatives of a tree's step;
//! - [`planar`]: a planar machine on a ground, with its matrices;
//! - [`grains`]: thousands of free disks or balls, and a planar machine among them;
//! - [`among_grains`]: a tree among balls.
//!
//! # One call
//!
//! A rover's step, seen from the tree; the order is that of [`crate::integrator`]:
//!
//! ```text
//! integrator                    TreeSystem                      asks
//! place_middle, place_end   ──► TreeLanes                       multibody::Poses
//! detect, relocate          ──► TreeSystem                      contact
//! update_mass_matrix        ──► TreeLanes: Drives θ_j, sand     multibody::MassMatrix
//! factorise                 ──► M̂ with Drives and sand          multibody::Factor
//! close_velocity, close_end ──► Loops                           contact::loops
//! load                      ──► bias, Drives, sand              multibody::bias
//! load_gyroscopic           ──► Gyroscopic                      multibody::coriolis
//! assemble, local, ...      ──► ContactSystem                   contact
//! balance                   ──► MomentumBalance                 multibody::momentum
//! revise, work, accept      ──► Drives, sand
//! ```
//!
//! # May use
//!
//! [`crate::quantity`], [`crate::scalar`], [`crate::spatial`], [`crate::law`],
//! [`crate::multibody`], [`crate::sand`], [`crate::geometry`], [`crate::contact`],
//! [`crate::problem`], [`crate::solver`], [`crate::integrator`], [`crate::planar`].

pub mod among_grains;
pub mod block;
pub mod command;
pub mod drives;
pub(crate) mod extent;
pub mod fitted_theta;
pub mod grains;
pub mod gyroscopic;
mod momentum_balance;
pub mod planar;
mod planar_matrices;
pub(crate) mod sand;
pub(crate) mod sand_patch;
mod sand_tangent;
pub(crate) mod sand_wheel;
mod six;
pub(crate) mod tangent;
pub mod tree;
pub(crate) mod tree_lanes;
pub mod tree_scratch;

pub use among_grains::{
    CompositeContact, CompositeKey, CompositeScratch, GrainTouch, TreeAmongGrains,
};
pub use command::{Command, Drive, HeldJoint, Wrench};
pub use planar::{PlanarContact, PlanarKey, PlanarScratch, PlanarSystem};
pub use tree::TreeSystem;
pub use tree_scratch::TreeScratch;
