//! Soils that cannot be.

use thiserror::Error;

use super::super::error::PlanarError;

/// A soil that cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SoilError {
    /// A number that is not finite or of the wrong sign.
    #[error(transparent)]
    Number(#[from] PlanarError),
    /// No disk at all.
    #[error("radius: needs at least one disk")]
    Empty,
    /// More disks than a soil may have.
    #[error("count: at most {limit} disks, are {count}")]
    TooMany {
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
    /// Two disks in one place.
    #[error("position[{second}]: overlaps disk {first}, their gap is {value} m")]
    Overlap {
        /// The disk of smaller number.
        first: usize,
        /// The other.
        second: usize,
        /// Their gap, m: negative.
        value: f64,
    },
    /// A disk in a wall or in the ground.
    #[error("position[{disk}]: reaches into {what}, the gap is {value} m")]
    InWall {
        /// Which disk.
        disk: usize,
        /// Which wall, in words.
        what: String,
        /// The gap, m: negative.
        value: f64,
    },
    /// A wheel in a disk, a wall or the ground.
    #[error("machine: wheel {wheel} reaches into {what}, the gap is {value} m")]
    WheelIn {
        /// Which wheel.
        wheel: usize,
        /// What it reaches into, in words.
        what: String,
        /// The gap, m: negative.
        value: f64,
    },
    /// Too few places for the disks that were asked for.
    #[error("width: {value} m leaves no room for a disk of {needed} m")]
    TooNarrow {
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
    /// A soil without a machine cannot drive.
    #[error("machine: the scene has none")]
    NoMachine,
}

impl SoilError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            Self::Number(number) => number.field(),
            Self::Empty => "radius".to_owned(),
            Self::TooMany { .. } => "count".to_owned(),
            Self::Length { field, .. } => (*field).to_owned(),
            Self::Overlap { second, .. } => format!("position[{second}]"),
            Self::InWall { disk, .. } => format!("position[{disk}]"),
            Self::WheelIn { .. } | Self::NoMachine => "machine".to_owned(),
            Self::TooNarrow { .. } => "width".to_owned(),
            Self::Range { .. } => "radius_max".to_owned(),
        }
    }
}
