//! Broad phase: which things come near each other, before any distance is computed.
//!
//! [`ball_tree`]: fixed balls near a place; [`interval_sweep`]: pairs among moving balls.

pub mod ball_tree;
pub mod interval_sweep;

pub use ball_tree::BallTree;
pub use interval_sweep::IntervalSweep;
