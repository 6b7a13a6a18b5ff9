//! Errors: commands and snapshots that are refused, steps without derivatives.

use thiserror::Error;

use crate::integrator::{OptionsError, StepError};
use crate::multibody::StateError;
use crate::pool::PoolError;

/// A torque or set-point that is refused.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CommandError {
    /// Wrong number of entries.
    #[error("{field}: needs {expected} entries, has {actual}")]
    Length {
        /// Name of the argument.
        field: &'static str,
        /// What the model needs.
        expected: usize,
        /// What was given.
        actual: usize,
    },
    /// NaN or infinite.
    #[error("{field}[{index}]: must be finite, is {value}")]
    NotFinite {
        /// Name of the argument.
        field: &'static str,
        /// Which entry.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// Negative gain.
    #[error("{field}: must not be negative, is {value}")]
    Negative {
        /// Name of the argument.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A set-point beyond the actuator's range.
    #[error("{field}[{index}]: must be within ±{limit} rad, is {value}")]
    BeyondLimit {
        /// Name of the argument.
        field: &'static str,
        /// Which entry.
        index: usize,
        /// What was given, rad.
        value: f64,
        /// rad.
        limit: f64,
    },
    /// A joint that is to be held without stiffness and damping.
    #[error(
        "solids[{solid}].hold: the joint {name:?} has no gains to hold it; state \
         hold = {{ stiffness, damping }} in the model, or give stiffness and damping to hold()"
    )]
    NoGains {
        /// Index of its solid in the description.
        solid: usize,
        /// Name of the joint.
        name: String,
    },
    /// A joint that the model does not have, or that is locked.
    #[error("{field}: there is no free joint named {name:?}")]
    UnknownJoint {
        /// Name of the argument.
        field: &'static str,
        /// What was given.
        name: String,
    },
    /// A solid that the model does not have.
    #[error("{field}: there is no solid named {name:?}")]
    UnknownSolid {
        /// Name of the argument.
        field: &'static str,
        /// What was given.
        name: String,
    },
}

/// A batch that cannot be built, or a command that it refuses.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum BatchError {
    /// No rovers.
    #[error("simulations: a batch needs at least one")]
    Empty,
    /// Rovers whose readings have different lengths.
    #[error("simulations[{index}]: has {actual} coordinates, the first has {expected}")]
    Differs {
        /// Which rover.
        index: usize,
        /// Coordinates of the first.
        expected: usize,
        /// Coordinates of the refused rover.
        actual: usize,
    },
    /// No rover of this number.
    #[error("index: must be below {len}, is {index}")]
    NoSuchRover {
        /// What was given.
        index: usize,
        /// Rovers in the batch.
        len: usize,
    },
    /// Threads that the operating system did not start.
    #[error("threads: {count} could not be started ({reason})")]
    Threads {
        /// Requested number; 0 stands for one per core.
        count: usize,
        /// Message of the operating system.
        reason: String,
    },
    /// A command of one rover.
    #[error("rover {index}: {error}")]
    Command {
        /// Which rover.
        index: usize,
        /// What is wrong with it.
        error: CommandError,
    },
    /// An option of one rover out of its range.
    #[error("rover {index}: {error}")]
    Options {
        /// Which rover.
        index: usize,
        /// What is wrong with it.
        error: OptionsError,
    },
}

/// A snapshot that does not fit the simulation.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SnapshotError {
    /// Taken from another model.
    #[error("snapshot: belongs to another model, or to other locked joints, than this simulation")]
    OtherModel,
    /// Not finite, or with contacts that the model cannot have.
    #[error("snapshot: its contents are damaged")]
    Damaged,
}

impl From<PoolError> for BatchError {
    fn from(PoolError { count, reason }: PoolError) -> Self {
        Self::Threads { count, reason }
    }
}

/// A step that cannot be linearised.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LinearisationError {
    /// The scheme is implicit in the forces.
    #[error("variant: only steps of the variant \"linearised\" can be linearised")]
    Variant,
    /// A perturbation outside its range.
    #[error("perturbation: must be from 1e-9 to 1e-3, is {value}")]
    Perturbation {
        /// What was given.
        value: f64,
    },
    /// The coordinates are singular.
    #[error("q[{index}]: the coordinates are singular at a pitch of 90 degrees, is {pitch} rad")]
    Singular {
        /// Index of the angle.
        index: usize,
        /// rad.
        pitch: f64,
    },
    /// A state that is none.
    #[error(transparent)]
    State(#[from] StateError),
    /// A command that the rover refuses.
    #[error(transparent)]
    Command(#[from] CommandError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The forces of the sand were not found to rounding.
    #[error(
        "the forces of the sand at the end of the step were found to {error:.1e} of their size \
         only, so that the step has no exact derivative; take a shorter time step"
    )]
    SandNotSolved {
        /// What is left, relative to the largest force.
        error: f64,
    },
    /// The step is not one solution of the step's equations.
    #[error(
        "the step was taken in parts, was not solved to its tolerance or was limited: it has no \
         derivative with fixed contact modes"
    )]
    NotHeld,
}
