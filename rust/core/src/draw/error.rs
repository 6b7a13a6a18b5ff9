//! Errors of a draw.

use thiserror::Error;

use crate::geometry::TerrainError;
use crate::integrator::OptionsError;
use crate::multibody::{ModelError, StateError};

/// Why no scene could be drawn.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DrawError {
    /// The rover would stand in the ground or in a sphere.
    #[error(
        "terrain: the rover stands {overlap} m deep in the ground or in a sphere at its start, in the last of \
         {attempts} scenes"
    )]
    NoRoom {
        /// Deepest gap in the last scene, negative, m.
        overlap: f64,
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
