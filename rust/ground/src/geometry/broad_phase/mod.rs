//! Broad phase: which things come near each other, before any distance is computed.
//!
//! [`ball_tree`]: fixed balls near a place or along a ray; [`box_tree`]: boxes along a ray;
//! [`interval_sweep`]: pairs among moving balls.

pub mod ball_tree;
pub mod bounds;
pub mod box_tree;
pub mod interval_sweep;

pub use ball_tree::BallTree;
pub use bounds::Bounds;
pub use box_tree::BoxTree;
pub use interval_sweep::IntervalSweep;
