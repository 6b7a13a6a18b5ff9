//! Paths over heights that are known on a grid: what a rover would touch on them, and which of many
//! is the cheapest.
//!
//! - [`pose`]: a place and a heading; [`grid`]: the heights, and the rover's points on them by
//!   pose; [`cost`]: what a path costs; [`risk`]: what the ground under a path costs; [`search`]:
//!   the cheapest path; [`ways`]: the way to a goal from all over a map.
//!
//! # One call
//!
//! The cheapest path over a patch of heights:
//!
//! ```text
//! heights, goal ──► GroundGrid::lay          heights under every pose of the grid
//!                      │
//!                      ▼
//!                   PathSearch::best         beam search over arcs of constant command
//!                      │   under             wheels and outline on the ground of each pose
//!                      │   PathCosts, PathRisk
//!                      ▼
//!                   the first command of the cheapest path
//! ```
//!
//! # May use
//!
//! [`rover_core::scalar`].
//!
//! No simulator: heights in, costs out.

pub mod cost;
pub mod grid;
pub mod pose;
pub mod risk;
pub mod search;
pub mod ways;

pub use cost::PathCosts;
pub use grid::{GroundGrid, ScanShape};
pub use pose::PlanarPose;
pub use risk::{GroundFit, Outline, PathRisk};
pub use search::{Arcs, PathProblem, PathSearch, SearchTask, Trap};
pub use ways::{MapTask, WayMap};
