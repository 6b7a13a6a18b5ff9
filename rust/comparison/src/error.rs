//! Errors of a scene or a measurement.

use rover_core::integrator::{OptionsError, StepError};
use rover_core::multibody::StateError;
use rover_core::planar::PlanarError;
use rover_core::simulation::CommandError;
use thiserror::Error;

/// A scene that could not be built, or a measurement that could not be made.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum MeasureError {
    /// See [`PlanarError`].
    #[error(transparent)]
    Planar(#[from] PlanarError),
    /// See [`OptionsError`].
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// See [`StateError`].
    #[error(transparent)]
    State(#[from] StateError),
    /// See [`CommandError`].
    #[error(transparent)]
    Command(#[from] CommandError),
    /// See [`StepError`].
    #[error(transparent)]
    Step(#[from] StepError),
}
