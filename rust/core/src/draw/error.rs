//! Errors of a draw.

use thiserror::Error;

use super::start::PlacementError;
use crate::geometry::TerrainError;
use crate::integrator::OptionsError;
use crate::multibody::{ModelError, StateError};

/// Why no scene could be drawn.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DrawError {
    /// The rover would stand in the ground or in a sphere.
    #[error(
        "terrain: the rover stands {depth} m deep in the ground or in a sphere at its start, in the last of \
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
        "goal: no ground is known at x = {x} m, z = {z} m: it is off the map or has no data there"
    )]
    NoGoal {
        /// World, m.
        x: f64,
        /// World, m.
        z: f64,
    },
    /// No way leads to the goal.
    #[error(
        "goal: no way leads from x = {} m, z = {} m to x = {} m, z = {} m on ground that rises by at most 30 degrees",
        from[0], from[1], to[0], to[1]
    )]
    NoWay {
        /// World (x, z), m.
        from: [f64; 2],
        /// World (x, z), m.
        to: [f64; 2],
    },
}
