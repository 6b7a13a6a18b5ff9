//! A machine on a terrain, stepped through time.

pub mod error;
pub mod profile;
pub mod rover;
pub mod snapshot;

pub use error::{CommandError, SnapshotError};
pub use rover::Simulation;
pub use snapshot::Snapshot;
