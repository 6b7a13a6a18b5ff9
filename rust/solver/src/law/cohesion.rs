//! Cohesion: a constant attraction between grains that touch, and of grains to what they lie on.
//!
//! While the gap of a contact is at most the range δ, an attraction F pulls the bodies together
//! along its normal. With p_N the whole normal impulse of a step h, Signorini's law becomes
//! `0 ≤ u_N + gap⁺/h ⊥ p_N + h F ≥ 0`, and Coulomb's bounds the tangential impulse by
//! μ (p_N + h F): a contact bears tension up to F, the breaking force, and has friction without
//! load. Parting costs F δ.
//!
//! The attraction is a load on both bodies, and the solver's impulse is p_N + h F, so no solver
//! knows of it.

use crate::quantity::{QuantityError, not_negative};

/// No cohesion.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum CohesionError {
    /// The force.
    #[error(transparent)]
    Force(#[from] QuantityError),
    /// A range of attraction that contacts do not have.
    #[error("cohesion_range: must be positive and at most {limit} m, is {value}")]
    Range {
        /// m.
        value: f64,
        /// A fifth of the smallest radius, m.
        limit: f64,
    },
}

/// Largest range, as a fraction of the smallest radius: detection looks no farther.
const FARTHEST: f64 = 0.2;

/// Range where none is given, as a fraction of the smallest radius: contacts at rest stay closer in
/// spite of the solver's tolerance.
const USUAL: f64 = 0.01;

impl CohesionError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> &str {
        match self {
            Self::Force(e) => e.field(),
            Self::Range { .. } => "cohesion_range",
        }
    }

    /// What was given.
    #[must_use]
    pub fn value(&self) -> f64 {
        match self {
            Self::Force(e) => e.value(),
            Self::Range { value, .. } => *value,
        }
    }
}

/// The attraction of contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cohesion {
    /// Attraction F, and the pull that breaks a contact, N.
    pub force: f64,
    /// Gap δ up to which it acts, m.
    pub range: f64,
}

impl Cohesion {
    /// Cohesion of this force (N) over this range (m; 1% of the smallest radius if none is given),
    /// among grains of at least the radius `smallest` (m).
    ///
    /// # Errors
    /// A force that is not finite or negative; a range that is not positive or beyond a fifth of
    /// the radius.
    pub fn new(force: f64, range: Option<f64>, smallest: f64) -> Result<Self, CohesionError> {
        not_negative("cohesion", force)?;
        let range = range.unwrap_or(USUAL * smallest);
        let limit = FARTHEST * smallest;
        if !(range > 0.0 && range <= limit) {
            return Err(CohesionError::Range {
                value: range,
                limit,
            });
        }
        Ok(Self { force, range })
    }

    /// The attraction at a gap (m), N.
    #[inline]
    #[must_use]
    pub fn at(&self, gap: f64) -> f64 {
        if gap <= self.range { self.force } else { 0.0 }
    }
}
