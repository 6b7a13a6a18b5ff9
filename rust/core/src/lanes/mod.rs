//! The fast step of a rover, one or several to a register.
//!
//! Most steps of a wheeled rover are alike: a tree of joints on a free base, wheels that roll and
//! slip, motors, springs and stops. The code of such a step is generic over a scalar
//! ([`crate::scalar`]): one rover, four or eight. The rovers of a block share their tree, so the
//! code branches on the kind of a joint or a wheel, never on its state. What is rare, such as a
//! chassis on the ground, is found rover by rover. If a rover needs something else, it leaves the
//! block before its state changes, and the general step of [`crate::integrator`] takes it.
//!
//! - [`machine`]: what the rovers of a block share; `parts`: its wheels, boxes and balls;
//!   [`lane_rover`]: what a block reads of a rover;
//! - [`ground`], `contact_plane`, `pieces`: the ground near a wheel; `rolling`, `joint_slots`:
//!   contacts of all lanes at once; `lane_detection`, `by_lane`, `free_slots`: of
//!   one lane; [`contacts`]: all of them, in slots;
//! - [`rows`]: Jacobian and Delassus operator; [`yielding`]: wheels that yield;
//! - `clusters`: which trees have a problem of their own; `sweeps`: where a contact that touches is
//!   solved with all others fixed. The problems are solved by [`crate::solver::batch`];
//! - [`step`]: the step. The dynamics of the tree are those of [`crate::multibody`], its drives
//!   those of [`crate::system`].
//!
//! # One call
//!
//! A step of a block of rovers; [`Queue`](crate::solver::batch::queue::Queue)
//! solves the problems of several blocks together:
//!
//! ```text
//! LaneRover ──► Block::load_rover     state, command and memory of one rover into its lane
//!                    │
//!                    ▼
//!               Block::prepare        poses, contacts, mass matrix, W, free velocity
//!                    │                a lane that cannot go on falls back; its state is unchanged
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
//! A lane that falls back takes the general step: [`crate::simulation`], [`crate::integrator`].
//!
//! # May use
//!
//! [`crate::scalar`], [`crate::law`], [`crate::multibody`], [`crate::sand`], [`crate::geometry`],
//! [`crate::contact`], [`crate::problem`], [`crate::solver`], [`crate::integrator`],
//! [`crate::system`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod by_lane;
mod clusters;
mod contact_plane;
pub mod contacts;
mod free_slots;
pub mod ground;
mod groups;
mod joint_slots;
mod lane_detection;
pub mod lane_rover;
pub mod machine;
mod parts;
mod pieces;
mod rolling;
pub mod rows;
pub mod step;
mod sweeps;
pub mod yielding;
