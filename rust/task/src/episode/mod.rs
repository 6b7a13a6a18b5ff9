//! Episodes of a driving task: what an action commands, what is observed, rewarded, and when it
//! ends.
//!
//! An agent chooses an action once a control period, which lasts several physics steps. The rover
//! is given the action's commands ([`action`]), takes its steps and is read
//! ([`rover_core::simulation::reading`]). From the reading follow the [`observation`], whose fields
//! [`channels`] declares (with [`noise`]), its [`quantities`], the [`progress`] of the episode, the
//! terms of the [`reward`] and whether and why the episode ends ([`ending`]); together they are the
//! period's [`outcome`].
//!
//! - [`settings`] and [`rules`]: what all episodes of a task share; [`beginning`]: how one begins,
//!   in a scene that is drawn ([`crate::draw`]); [`setting`]: what was drawn for it;
//! - [`running`]: one episode and its control period;
//! - [`batch`]: many rovers side by side, each with its episode.
//!
//! # One call
//!
//! One control period, alone or as a row of a batch:
//!
//! ```text
//! action ──► Episode::command      wheel torques and steering           action
//!               │
//!               ▼
//!            simulation            several physics steps                rover_core::simulation
//!               │
//!               ▼
//!            read_state, read_heights
//!               │
//!               ▼
//!            Episode::advance      quantities → progress → reward terms → ending → observation
//!               │
//!               ▼
//!            Outcome               observation, terms, ending
//! ```
//!
//! # May use
//!
//! [`rover_core::scalar`], [`rover_core::multibody`], [`rover_core::integrator`],
//! [`rover_core::simulation`], [`crate::draw`].

pub mod action;
pub mod batch;
pub mod beginning;
pub mod channels;
mod control_period;
pub mod ending;
pub mod error;
pub mod noise;
pub mod observation;
pub mod outcome;
pub mod progress;
pub mod quantities;
pub mod reward;
pub mod rules;
pub mod running;
pub mod setting;
pub mod settings;

pub use batch::{BatchOutcome, EpisodeBatch, SharedRover, StepAmong};
pub use beginning::{Beginning, EpisodeDistribution};
pub use control_period::EpisodeOrigin;
pub use ending::Ending;
pub use error::EpisodeError;
pub use outcome::Outcome;
pub use progress::Progress;
pub use quantities::{N_QUANTITIES, Quantities};
pub use reward::{N_TERMS, TERMS, Weights};
pub use rules::Rules;
pub use running::{Episode, EpisodeState};
pub use setting::EpisodeSetting;
pub use settings::Settings;
