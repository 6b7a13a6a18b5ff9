//! Errors of a draw.

use thiserror::Error;

use rover_core::contact::placement::PlacementError;
use rover_core::geometry::TerrainError;
use rover_core::integrator::OptionsError;
use rover_core::multibody::{ModelError, StateError};

/// Why no scene could be drawn.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DrawError {
    /// The rover would stand in the ground or in a sphere.
    #[error(
        "terrain: the rover penetrates the ground or a sphere by {depth} m at its start, in the last of \
         {attempts} scenes"
    )]
    NoRoom {
        /// How deep it stands in the last scene, m.
        depth: f64,
        /// Scenes that were drawn.
        attempts: usize,
    },
    /// Start and goal do not suit the ground, in the last of the scenes that were drawn.
    #[error("{why}, in the last of {attempts} scenes")]
    Unsuitable {
        /// Why.
        why: Unsuitable,
        /// Scenes that were drawn.
        attempts: usize,
    },
    /// The ground refuses a number.
    #[error(transparent)]
    Terrain(#[from] TerrainError),
    /// The scaled model is none.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The state does not fit the model.
    #[error(transparent)]
    State(#[from] StateError),
    /// An option is out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),
}

/// Why a start and a goal do not suit the ground.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Unsuitable {
    /// The rover cannot be put there.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// The ground under the goal is not known.
    #[error(
        "goal: the ground at x = {x} m, z = {z} m is unknown: the place is outside the map or has no data"
    )]
    NoGoal {
        /// World, m.
        x: f64,
        /// World, m.
        z: f64,
    },
    /// No way leads to the goal.
    #[error(
        "goal: there is no path from x = {} m, z = {} m to x = {} m, z = {} m without slopes above 30 degrees",
        from[0], from[1], to[0], to[1]
    )]
    NoWay {
        /// World (x, z), m.
        from: [f64; 2],
        /// World (x, z), m.
        to: [f64; 2],
    },
}
