//! What can be wrong with a terrain.

use thiserror::Error;

/// A terrain that cannot be.
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
}

impl TerrainError {
    /// Name of the offending field.
    #[must_use]
    pub fn field(&self) -> &'static str {
        match self {
            Self::NotFinite { field, .. } => field,
            Self::NoDirection { .. } => "normal",
        }
    }
}
