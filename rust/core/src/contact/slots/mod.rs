//! The contacts of machines in the lanes of a register, in slots that the lanes share.
//!
//! The code branches on the kind of a joint or a wheel, never on the state of a lane. What is rare,
//! such as a chassis on the ground, is found lane by lane.
//!
//! - [`machine`]: what the machines in the lanes share; `parts`: its wheels, boxes and balls;
//! - [`ground`], `contact_plane`, `pieces`: the ground near a wheel; `rolling`, `joint_slots`:
//!   contacts of all lanes at once; `lane_detection`, `by_lane`, `free_slots`: of one lane;
//!   [`contacts`]: all of them, in slots;
//! - [`rows`]: Jacobian and Delassus operator; `yielding`: wheels that yield;
//! - `clusters`: which trees have a problem of their own; `sweeps`: where a contact that touches is
//!   solved with all others fixed. The problems are solved by [`crate::solver::batch`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod by_lane;
mod clusters;
mod contact_plane;
pub mod contacts;
mod free_slots;
pub mod ground;
pub(crate) mod joint_slots;
mod lane_detection;
pub mod machine;
mod parts;
mod pieces;
mod rolling;
pub mod rows;
pub(crate) mod sweeps;
pub(crate) mod yielding;
