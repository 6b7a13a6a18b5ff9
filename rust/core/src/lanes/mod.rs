//! The fast step of a rover, one or several to a register.
//!
//! Most steps of a wheeled rover are alike: a tree of joints on a free base, wheels that roll and
//! slip, motors, springs and stops. These sources take such a step over a scalar
//! ([`crate::scalar`]) that is one rover or four or eight. They branch on the kind of joint body by
//! body, since the rovers of a block share their tree. What is rare, such as a body that touches
//! the ground, is found rover by rover. A step that cannot be taken so falls back to
//! [`crate::integrator`], rover by rover, before anything has changed.
//!
//! The dynamics of the tree are those of [`crate::multibody`].
//!
//! - [`admission`]: which options have a fast step; [`machine`]: what the rovers share;
//! - `parts`, [`ground`], `footing`, `pieces`, `rolling`, [`forecast`], [`contacts`], `by_lane`,
//!   `rare`, `spares`, `stops`: what touches what;
//!   [`rows`]: Jacobian and Delassus operator; [`yielding`]: wheels that yield;
//! - [`problem`], [`modes`], [`equations`], [`pattern`], `tree_matrix`, `velocity_equations`,
//!   `sweeps`, `pivoting`, `visits`, `bench`, [`queue`]: the friction-contact problems;
//! - [`step`]: the step.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod admission;
mod bench;
mod by_lane;
pub mod contacts;
pub mod drives;
pub mod equations;
mod footing;
pub mod forecast;
pub mod ground;
pub mod machine;
pub mod modes;
mod parts;
pub mod passenger;
pub mod pattern;
mod pieces;
mod pivoting;
pub mod problem;
pub mod queue;
mod rare;
mod rolling;
pub mod rows;
mod spares;
pub mod step;
mod stops;
mod sweeps;
mod system;
mod tread;
mod tree_matrix;
mod velocity_equations;
mod visits;
pub mod yielding;
