//! A machine on a terrain, stepped through time.

pub mod error;
pub mod profile;
pub mod rover;
pub mod snapshot;

pub use error::{CommandError, SnapshotError};
pub use rover::Simulation;
pub(crate) use rover::check as check_command;
pub use snapshot::Snapshot;
