//! Grains that cannot be.

use thiserror::Error;

use crate::law::cohesion::CohesionError;
use crate::quantity::QuantityError;

/// Grains that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GrainError {
    /// A number that is not finite or has the wrong sign.
    #[error(transparent)]
    Number(#[from] QuantityError),
    /// No grain at all.
    #[error("radius: needs at least one entry")]
    Empty,
    /// More grains than there may be.
    #[error("count: at most {limit} {noun}s are allowed, is {count}")]
    TooMany {
        /// What they are called.
        noun: &'static str,
        /// How many there are, or would be.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Lists of different lengths.
    #[error("{field}: needs {expected} entries, has {count}")]
    Length {
        /// Name of the argument.
        field: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many there are.
        count: usize,
    },
    /// Two grains in one place.
    #[error("position[{second}]: overlaps {noun} {first}, their gap is {value} m")]
    Overlap {
        /// What they are called.
        noun: &'static str,
        /// Index of the first grain, the smaller one.
        first: usize,
        /// Index of the second grain, the larger one.
        second: usize,
        /// Their gap, m: negative.
        value: f64,
    },
    /// A grain in a wall or in the ground.
    #[error("position[{grain}]: penetrates {what}, the gap is {value} m")]
    InWall {
        /// Which grain.
        grain: usize,
        /// Which wall, in words.
        what: String,
        /// The gap, m: negative.
        value: f64,
    },
    /// A wheel in a grain, a wall or the ground.
    #[error("machine: wheel {wheel} penetrates {what}, the gap is {value} m")]
    WheelIn {
        /// Which wheel.
        wheel: usize,
        /// Grain, wall or ground that the wheel penetrates, in words.
        what: String,
        /// The gap, m: negative.
        value: f64,
    },
    /// No place for a grain between the sides.
    #[error("{field}: {value} m leaves no room for a {noun} of {needed} m")]
    TooNarrow {
        /// Name of the argument.
        field: &'static str,
        /// What a grain is called.
        noun: &'static str,
        /// m.
        value: f64,
        /// m.
        needed: f64,
    },
    /// A range whose ends are the wrong way round.
    #[error("radius_max: must be at least radius_min, is {value}")]
    Range {
        /// m.
        value: f64,
    },
    /// An attraction that contacts do not have.
    #[error(transparent)]
    Cohesion(#[from] CohesionError),
    /// A grain that was not there, or not in this order.
    #[error(
        "before[{grain}]: must be the index of a ball and larger than the entries before it, is {value}"
    )]
    Before {
        /// Which grain.
        grain: usize,
        /// The number.
        value: usize,
    },
    /// Where there is no machine, none can drive.
    #[error("machine: the scene has no machine")]
    NoMachine,
}

/// Checks the number of entries of an argument.
pub(crate) fn check_length(
    field: &'static str,
    expected: usize,
    count: usize,
) -> Result<(), GrainError> {
    if count == expected {
        return Ok(());
    }
    Err(GrainError::Length {
        field,
        expected,
        count,
    })
}

impl GrainError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            Self::Number(number) => number.field().to_owned(),
            Self::Empty => "radius".to_owned(),
            Self::TooMany { .. } => "count".to_owned(),
            Self::Length { field, .. } | Self::TooNarrow { field, .. } => (*field).to_owned(),
            Self::Overlap { second, .. } => format!("position[{second}]"),
            Self::InWall { grain, .. } => format!("position[{grain}]"),
            Self::Before { grain, .. } => format!("before[{grain}]"),
            Self::WheelIn { .. } | Self::NoMachine => "machine".to_owned(),
            Self::Range { .. } => "radius_max".to_owned(),
            Self::Cohesion(e) => e.field().to_owned(),
        }
    }
}
