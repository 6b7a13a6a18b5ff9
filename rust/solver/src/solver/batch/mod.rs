//! The friction-contact problems of many machines at once, each in a lane of its own.
//!
//! - [`problem`]: a problem with `W` or with its factors; [`pattern`]: which velocities a contact
//!   of a machine moves, so which entries of the factors are not zero;
//! - `blocks`: the linear system of a Newton step with the whole operator; `dry`: with joints that
//!   rub, one unknown each; `velocities`, `tree_matrix`: set up in the machine's velocities;
//!   `loaded`: how problems enter them;
//! - `lane_solver`: lanes that pivot, each on its own problem; [`queue`]: which problem comes next.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod blocks;
mod dry;
mod lane_solver;
mod loaded;
pub mod pattern;
pub mod problem;
pub mod queue;
mod tree_matrix;
mod velocities;
