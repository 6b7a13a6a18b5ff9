//! A scene stepped through time.
//!
//! - [`scene`]: what can be simulated, and the data needed to continue; [`stepping`]: the one
//!   simulation of all scenes;
//! - [`state`], [`active_contact`]: its state, its contacts; [`any_snapshot`]: what files keep,
//!   [`sealed`] with a checksum;
//! - [`rover`]: a rover on a terrain, with its [command](rover_command), its
//!   [controls](rover_controls), its [contacts](rover_contacts), its block (`own_block`,
//!   `rover_lanes`), its [`reading`], what [rays](rover_rays) meet, its [pictures](rover_picture), and
//!   the [`linearisation`] of a step by a [`differentiator`], with `steps_in_sand` whose forces are
//!   exact;
//! - [`planar`]: a planar machine on a ground; [`grains`]: a bed of grains,
//!   perhaps with a machine on it;
//! - [`rover_in_grains`]: a rover and a bed of balls, stepped together;
//! - [`batch`]: many rovers side by side, each with its [turn](turns); [`profile`]: time
//!   spent in each part of a step.
//!
//! # One call
//!
//! ```text
//! Simulation::step(n)
//!    │
//!    ├─ Scene::begin_call
//!    └─ n times ─┬─ Scene::usual_step         a rover, in its block
//!                └─ step_with_all_effort      Scene::system ──► Integrator::step
//!                      │
//!                      ▼
//!                   State, WarmStart, ActiveContact
//!    │
//!    ▼
//! StepReport, merged over the call
//! ```
//!
//! A Batch: every rover gets its turns, several rovers to a block of lanes, blocks over threads.
//!
//! # May use
//!
//! [`crate::caught`], [`crate::pool`], [`crate::quantity`], [`crate::scalar`], [`crate::spatial`],
//! [`crate::multibody`],
//! [`crate::sand`], [`crate::geometry`], [`crate::contact`], [`crate::problem`],
//! [`crate::law`], [`crate::solver`], [`crate::integrator`], [`crate::planar`], [`crate::system`].
// Registers of other processors hold one rover: nothing there uses blocks of lanes.
#![cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]

pub mod active_contact;
pub mod any_snapshot;
pub mod batch;
pub mod differentiator;
pub mod error;
pub mod grains;
pub mod lane_batch;
pub mod linearisation;
mod own_block;
pub mod planar;
pub mod profile;
pub mod reading;
pub mod rover;
pub mod rover_command;
pub mod rover_contacts;
pub mod rover_controls;
pub mod rover_in_grains;
mod rover_lanes;
pub mod rover_picture;
pub mod rover_rays;
mod rover_sand;
pub mod scene;
pub mod sealed;
pub mod state;
pub mod step_parameter;
pub mod stepping;
mod steps_in_sand;
pub mod turns;

pub use active_contact::{ActiveContact, LocatedContact};
pub use any_snapshot::AnySnapshot;
pub use batch::Batch;
pub use differentiator::{
    Differentiator, Trajectory, TrajectoryBatch, TrajectoryError, state_size, with_sand,
};
pub use error::{BatchError, CommandError, LinearisationError, SnapshotError};
pub use grains::{
    BedCommand, BedMemory, DiskSimulation, GrainBed, GrainSetupError, GrainSimulation,
    grain_options,
};
pub use linearisation::{ColumnCheck, Linearisation};
pub use planar::{PlanarScene, PlanarSimulation};
pub use reading::{ReadingLayout, ReadingRequest, ReadingScratch, seen_from};
pub use rover::{LastCall, PlacedRover, RoverScene, RoverSimulation};
pub use rover_command::RoverCommand;
pub use rover_controls::WheelCommands;
pub use rover_in_grains::{RoverInGrains, TogetherError};
pub use rover_picture::Shown;
pub use scene::{
    AcceptedStep, DenseOperator, Scene, SceneKey, SceneScratch, Snapshot, UsualOutcome, UsualStep,
};
pub use state::State;
pub use step_parameter::StepParameter;
pub use stepping::Simulation;
pub use turns::{Done, Turn, Workers};
