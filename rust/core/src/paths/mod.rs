//! Paths over heights that are known on a grid: what a rover would touch on them, and which of many
//! is the cheapest.
//!
//! - [`pose`]: a place and a heading; [`grid`]: the heights, and the rover's points on them by
//!   pose; [`cost`]: what a path costs; [`risk`]: what the ground under a path costs; [`search`]:
//!   the cheapest path; [`ways`]: the way to a goal from all over a map.

pub mod cost;
pub mod grid;
pub mod pose;
pub mod risk;
pub mod search;
pub mod ways;

pub use cost::PathCosts;
pub use grid::{GroundGrid, ScanShape};
pub use pose::Pose;
pub use risk::{Outline, PathRisk, Stand};
pub use search::{Arcs, PathSearch, Search, SearchTask, Trap};
pub use ways::{MapTask, WayMap};
