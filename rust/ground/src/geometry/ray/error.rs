//! Errors of rays.

use thiserror::Error;

/// Rays that cannot be cast.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum RayError {
    /// Different numbers of origins and directions.
    #[error("directions: needs one for each of the {origins} origins, has {directions}")]
    MismatchedLengths {
        /// Number of origins.
        origins: usize,
        /// Number of directions.
        directions: usize,
    },
    /// NaN or infinite.
    #[error("{field}[{index}]: must be finite, is {value}")]
    NotFinite {
        /// `origins` or `directions`.
        field: &'static str,
        /// Number of the ray, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// So far from the world's origin that a distance loses its precision.
    #[error("origins[{index}]: must be at most {limit} m in size, is {value}")]
    TooFar {
        /// Number of the ray, from 0.
        index: usize,
        /// What was given, m.
        value: f64,
        /// Largest allowed, m.
        limit: f64,
    },
    /// A direction of length zero.
    #[error("directions[{index}]: must have a direction, is zero")]
    NoDirection {
        /// Number of the ray, from 0.
        index: usize,
    },
    /// A range that is NaN, zero or negative.
    #[error("max_range: must be positive, is {value}")]
    BadRange {
        /// What was given, m.
        value: f64,
    },
}

impl RayError {
    /// Name of the offending field.
    #[must_use]
    pub fn field(&self) -> &'static str {
        match self {
            Self::NotFinite { field, .. } => field,
            Self::TooFar { .. } => "origins",
            Self::MismatchedLengths { .. } | Self::NoDirection { .. } => "directions",
            Self::BadRange { .. } => "max_range",
        }
    }
}
