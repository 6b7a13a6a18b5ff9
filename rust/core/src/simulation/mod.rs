//! A machine on a terrain, stepped through time.

pub mod batch;
pub mod error;
mod pool;
pub mod profile;
pub mod reading;
pub mod rover;
pub mod snapshot;

pub use batch::Batch;
pub use error::{BatchError, CommandError, SnapshotError};
pub use reading::{Look, ReadingLayout};
pub use rover::Simulation;
pub(crate) use rover::check as check_command;
pub use snapshot::Snapshot;
