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
//! - `parts`, [`ground`], `contact_plane`, `pieces`, `rolling`, [`forecast`], [`contacts`],
//!   `by_lane`, `lane_detection`, `free_slots`, `stops`: what touches what;
//!   [`rows`]: Jacobian and Delassus operator; [`yielding`]: wheels that yield;
//! - [`problem`], `system`, `equations`, [`pattern`], `tree_matrix`, `velocity_equations`,
//!   `sweeps`, `lane_solver`, [`queue`]: the friction-contact problems, which
//!   [`crate::solver`]'s pivoting solves;
//! - [`step`]: the step.
//!
//! # One call
//!
//! A step of a block of rovers; `queue` solves the problems of several blocks together:
//!
//! ```text
//! LaneRover ──► Block::load_rover     state, command and memory of one rover into its lane
//!                    │
//!                    ▼
//!               Block::prepare        poses, contacts, mass matrix, W, free velocity
//!                    │                a lane that cannot go on is declined; its state is unchanged
//!                    ▼
//!               Queue                 the friction-contact problems
//!                    │
//!                    ▼
//!               Block::conclude       new state, motors' branches, energy audit
//!                    │  Next          again, or the problem of the position projection
//!                    ▼
//!               Block::finish ──► Block::store_rover
//! ```
//!
//! A declined lane takes the general step: [`crate::simulation`], [`crate::integrator`].
//!
//! # May use
//!
//! [`crate::scalar`], [`crate::law`], [`crate::multibody`], [`crate::geometry`],
//! [`crate::contact`], [`crate::problem`], [`crate::solver`], [`crate::integrator`],
//! [`crate::system`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod admission;
mod by_lane;
mod contact_plane;
pub mod contacts;
mod equations;
pub mod forecast;
mod free_slots;
pub mod ground;
mod lane_detection;
pub mod lane_rover;
mod lane_solver;
pub mod machine;
mod parts;
pub mod pattern;
mod pieces;
pub mod problem;
pub mod queue;
mod rolling;
pub mod rows;
pub mod step;
mod stops;
mod sweeps;
mod system;
mod tree_matrix;
mod velocity_equations;
mod wide_wheel;
pub mod yielding;
