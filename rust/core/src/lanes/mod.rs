//! The fast step of a rover, one or several to a register.
//!
//! Most steps of a wheeled rover are alike: a tree of joints on a free base, wheels that roll and
//! slip, motors, springs and stops. Several rovers of one machine take them together
//! ([`crate::integrator::scheme`]), in the lanes of a scalar ([`crate::scalar`]): one, four or
//! eight. They share their tree, so the code branches on the kind of a joint or a wheel, never on
//! its state. What is rare, such as a chassis on the ground, is found rover by rover. If a rover
//! needs something else, it leaves the block before its state changes, and
//! [`crate::integrator::moreau_jean`] takes its step alone.
//!
//! - [`machine`]: what the rovers of a block share; `parts`: its wheels, boxes and balls;
//!   [`lane_rover`]: what a block reads of a rover;
//! - [`ground`], `contact_plane`, `pieces`: the ground near a wheel; `rolling`, `joint_slots`:
//!   contacts of all lanes at once; `lane_detection`, `by_lane`, `free_slots`: of
//!   one lane; [`contacts`]: all of them, in slots;
//! - [`rows`]: Jacobian and Delassus operator; `yielding`: wheels that yield;
//! - `clusters`: which trees have a problem of their own; `sweeps`: where a contact that touches is
//!   solved with all others fixed. The problems are solved by [`crate::solver::batch`];
//! - [`block`]: rovers that take their steps together, as the systems of the scheme. The dynamics
//!   of the tree are those of [`crate::multibody`], its drives those of [`crate::system`].
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
//! A lane that falls back takes its step alone: [`crate::simulation`], [`crate::integrator`].
//!
//! # May use
//!
//! [`crate::scalar`], [`crate::law`], [`crate::multibody`], [`crate::sand`], [`crate::geometry`],
//! [`crate::contact`], [`crate::problem`], [`crate::solver`], [`crate::integrator`],
//! [`crate::system`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod block;
mod by_lane;
mod clusters;
mod contact_plane;
pub mod contacts;
mod free_slots;
pub mod ground;
mod joint_slots;
mod lane_detection;
pub mod lane_rover;
pub mod machine;
mod parts;
mod pieces;
mod rolling;
pub mod rows;
mod sweeps;
mod yielding;
