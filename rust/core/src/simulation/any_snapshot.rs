//! The snapshot of a simulation of any kind: what files and other languages keep.

use serde::{Deserialize, Serialize};

use super::{GrainBed, PlanarScene, RoverScene, Snapshot};

/// A snapshot with its kind. Its order is that of the bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum AnySnapshot {
    /// A rover.
    Rover(Snapshot<RoverScene>),
    /// A planar machine.
    Planar(Snapshot<PlanarScene>),
    /// Disks, with a planar machine among them or without.
    Disks(Snapshot<GrainBed<2>>),
    /// Balls.
    Balls(Snapshot<GrainBed<3>>),
    /// A rover among balls.
    Among(Box<(Snapshot<RoverScene>, Snapshot<GrainBed<3>>)>),
}
