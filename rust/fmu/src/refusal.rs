//! Calls that are refused.

use rover_core::integrator::{OptionsError, StepError};
use rover_core::multibody::ModelError;
use rover_core::simulation::{CommandError, SnapshotError};
use thiserror::Error;

use crate::state::UnitMode;

/// Why a call is refused. Nothing has changed.
#[derive(Debug, Error)]
pub enum Refusal {
    /// The scene that travels with the unit cannot be read.
    #[error("{path}: {message}")]
    Scene {
        /// The file.
        path: String,
        /// What is wrong with it.
        message: String,
    },
    /// The unit was built with another description.
    #[error("instantiationToken: must be {expected:?}, is {actual:?}")]
    Token {
        /// The scene's.
        expected: String,
        /// What was given.
        actual: String,
    },
    /// A call that is not allowed in this state.
    #[error("{call}: is not allowed in the state {mode:?}")]
    OutOfOrder {
        /// The function.
        call: &'static str,
        /// The state of the unit.
        mode: UnitMode,
    },
    /// A function that the unit does not offer.
    #[error("{call}: is not supported")]
    Unsupported {
        /// The function.
        call: &'static str,
    },
    /// An argument that is a null pointer.
    #[error("{argument}: must not be null")]
    Null {
        /// Name of the argument.
        argument: &'static str,
    },
    /// A text that is not UTF-8.
    #[error("{argument}: must be UTF-8")]
    Text {
        /// Name of the argument.
        argument: &'static str,
    },
    /// A value reference without a variable of this type.
    #[error("valueReferences: {reference} is no variable of this type")]
    NoVariable {
        /// What was given.
        reference: u32,
    },
    /// A variable that cannot be set, or not in this state.
    #[error("{name}: cannot be set in the state {mode:?}")]
    ReadOnly {
        /// The variable.
        name: String,
        /// The state of the unit.
        mode: UnitMode,
    },
    /// Another number of values than of variables.
    #[error("nValues: must be {expected}, is {actual}")]
    Count {
        /// What the variables need.
        expected: usize,
        /// What was given.
        actual: usize,
    },
    /// A number out of its range.
    #[error("{name}: must be {range}, is {value}")]
    OutOfRange {
        /// The variable or argument.
        name: String,
        /// What is admissible.
        range: String,
        /// What was given.
        value: f64,
    },
    /// A model with other joints or wheels than the unit's variables.
    #[error("model: must have the joints {joints:?} and the wheels {wheels:?}")]
    OtherModel {
        /// Names of the joints.
        joints: Vec<String>,
        /// Names of the wheels.
        wheels: Vec<String>,
    },
    /// Bytes that are no state of this unit.
    #[error("serializedState: {message}")]
    State {
        /// What is wrong with them.
        message: String,
    },
    /// A model that cannot be read or built.
    #[error("model: {0}")]
    Model(#[from] ModelError),
    /// A command that the rover does not take.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// A parameter out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A state of another rover.
    #[error("the state: {0}")]
    Snapshot(#[from] SnapshotError),
    /// A step that failed.
    #[error("fmi3DoStep: {0}")]
    Step(#[from] StepError),
}
