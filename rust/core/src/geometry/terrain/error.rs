//! Errors of a terrain.

use thiserror::Error;

/// An invalid terrain.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum TerrainError {
    /// NaN or infinite.
    #[error("{field}: must be finite, is {value}")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A normal of length zero.
    #[error("normal: must have a direction, is {value:?}")]
    NoDirection {
        /// What was given.
        value: [f64; 3],
    },
    /// A sphere's centre or radius that is NaN or infinite.
    #[error("{field}[{index}]: must be finite, is {value}")]
    EntryNotFinite {
        /// `centres` or `radii`.
        field: &'static str,
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// A radius that is zero or negative.
    #[error("radii[{index}]: must be positive, is {radius}")]
    NonPositiveRadius {
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given, m.
        radius: f64,
    },
    /// A sphere so far from the origin that a wheel next to it cannot be resolved, or so large.
    #[error("{field}[{index}]: must be at most {limit} in size, is {value}")]
    TooFar {
        /// `centres` or `radii`.
        field: &'static str,
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given, m.
        value: f64,
        /// Largest allowed, m.
        limit: f64,
    },
    /// As many centres as radii are needed.
    #[error("radii: needs one for each of the {centres} centres, has {radii}")]
    MismatchedLengths {
        /// Number of centres.
        centres: usize,
        /// Number of radii.
        radii: usize,
    },
    /// Neither a sphere nor a plane.
    #[error("centres: a field needs a sphere or a ground plane, has neither")]
    Empty,
    /// More spheres than a field may have.
    #[error("centres: at most {limit} spheres, are {count}")]
    TooMany {
        /// How many there are, or would be.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A number that describes a field of rocks, outside its range.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
}

impl TerrainError {
    /// Name of the offending field.
    #[must_use]
    pub fn field(&self) -> &'static str {
        match self {
            Self::NotFinite { field, .. }
            | Self::EntryNotFinite { field, .. }
            | Self::TooFar { field, .. }
            | Self::OutOfRange { field, .. } => field,
            Self::NoDirection { .. } => "normal",
            Self::NonPositiveRadius { .. } | Self::MismatchedLengths { .. } => "radii",
            Self::Empty | Self::TooMany { .. } => "centres",
        }
    }
}
