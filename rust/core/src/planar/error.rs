//! Planar scenes that cannot be.

use thiserror::Error;

/// A curve or a machine that cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PlanarError {
    /// NaN or infinite.
    #[error("{field}: must be finite, is {value}")]
    NotFinite {
        /// Name of the argument.
        field: String,
        /// What was given.
        value: f64,
    },
    /// Zero or negative where that has no meaning.
    #[error("{field}: must be positive, is {value}")]
    NotPositive {
        /// Name of the argument.
        field: String,
        /// What was given.
        value: f64,
    },
    /// Negative.
    #[error("{field}: must not be negative, is {value}")]
    Negative {
        /// Name of the argument.
        field: String,
        /// What was given.
        value: f64,
    },
    /// So large or so small that the mechanics would overflow or vanish.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the argument.
        field: String,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// More points than a curve may have.
    #[error("x: at most {limit} points, has {count}")]
    TooManyPoints {
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Two wheels in one place.
    #[error(
        "axle_b: the wheels overlap: their axles are {value} m apart, their radii add up to {needed} m"
    )]
    WheelsOverlap {
        /// Distance of the axles, m.
        value: f64,
        /// Sum of the radii, m.
        needed: f64,
    },
    /// Too few points for a curve.
    #[error("x: needs at least {needed} points, has {count}")]
    TooFewPoints {
        /// How many are needed.
        needed: usize,
        /// How many there are.
        count: usize,
    },
    /// Another number of heights than of places.
    #[error("y: needs one entry for each of the {expected} in x, has {count}")]
    MismatchedLengths {
        /// Length of x.
        expected: usize,
        /// Length of y.
        count: usize,
    },
    /// The curve turns back: it is not a function of x.
    #[error("x[{index}]: must be {demand} the entry before it, is {value}")]
    NotAFunction {
        /// Which point.
        index: usize,
        /// `greater than`, or `at least` where vertical faces are allowed.
        demand: &'static str,
        /// What was given.
        value: f64,
    },
    /// The same point twice.
    #[error("y[{index}]: repeats the point before it, {value}")]
    RepeatedPoint {
        /// Which point.
        index: usize,
        /// Its height.
        value: f64,
    },
    /// A solid of a rover that has no mirror image, or turns out of the plane.
    #[error(
        "model: {body} has no mirror image on the other side, or is turned out of the plane: no planar model"
    )]
    NotMirrored {
        /// Its name.
        body: String,
    },
    /// A rover with another number of planar coordinates than there is a simulation for.
    #[error("model: needs {expected} coordinates in the plane, has {count}")]
    CoordinateCount {
        /// How many are needed.
        expected: usize,
        /// How many there are.
        count: usize,
    },
}

impl PlanarError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            Self::NotFinite { field, .. }
            | Self::NotPositive { field, .. }
            | Self::Negative { field, .. }
            | Self::OutOfRange { field, .. } => field.clone(),
            Self::WheelsOverlap { .. } => "axle_b".to_owned(),
            Self::NotMirrored { .. } | Self::CoordinateCount { .. } => "model".to_owned(),
            Self::TooFewPoints { .. } | Self::TooManyPoints { .. } => "x".to_owned(),
            Self::MismatchedLengths { .. } => "y".to_owned(),
            Self::NotAFunction { index, .. } => format!("x[{index}]"),
            Self::RepeatedPoint { index, .. } => format!("y[{index}]"),
        }
    }
}

/// `value`, if it is finite.
///
/// # Errors
/// [`PlanarError::NotFinite`].
pub fn finite(field: &str, value: f64) -> Result<f64, PlanarError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(PlanarError::NotFinite {
            field: field.to_owned(),
            value,
        })
    }
}

/// `value`, if it is finite and positive.
///
/// # Errors
/// [`PlanarError::NotFinite`] or [`PlanarError::NotPositive`].
pub fn positive(field: &str, value: f64) -> Result<f64, PlanarError> {
    if finite(field, value)? > 0.0 {
        Ok(value)
    } else {
        Err(PlanarError::NotPositive {
            field: field.to_owned(),
            value,
        })
    }
}

/// Numbers that an argument may have, with words for them.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Smallest and largest size; either sign where the smallest is negative.
    pub ends: [f64; 2],
    /// In words.
    pub words: &'static str,
}

/// Masses, kg.
pub const MASSES: Range = Range {
    ends: [1e-9, 1e12],
    words: "from 1e-9 to 1e12 kg",
};

/// Lengths, m.
pub const LENGTHS: Range = Range {
    ends: [1e-6, 1e6],
    words: "from 1e-6 to 1e6 m",
};

/// Inertias, kg m².
pub const INERTIAS: Range = Range {
    ends: [1e-24, 1e24],
    words: "from 1e-24 to 1e24 kg m²",
};

/// Places, m.
pub const PLACES: Range = Range {
    ends: [-1e6, 1e6],
    words: "at most 1e6 m either way",
};

/// `value`, if it is within a range; positive where the range is. `field`: its name.
///
/// # Errors
/// [`PlanarError::NotFinite`], [`PlanarError::NotPositive`] or [`PlanarError::OutOfRange`].
pub fn within(field: impl Fn() -> String, value: f64, range: Range) -> Result<f64, PlanarError> {
    let Range {
        ends: [low, high],
        words,
    } = range;
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    finite(&field(), value)?;
    if low > 0.0 {
        positive(&field(), value)?;
    }
    Err(PlanarError::OutOfRange {
        field: field(),
        range: words,
        value,
    })
}
