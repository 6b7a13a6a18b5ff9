//! Errors of planar scenes.

use thiserror::Error;

use crate::quantity::QuantityError;

/// A curve or a machine that cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PlanarError {
    /// A number that is not finite, of the wrong sign or out of its range.
    #[error(transparent)]
    Number(#[from] QuantityError),
    /// More points than a curve may have.
    #[error("x: at most {limit} points are allowed, has {count}")]
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
    /// A point of the curve that repeats the one before it.
    #[error("y[{index}]: repeats the point before it, {value}")]
    RepeatedPoint {
        /// Which point.
        index: usize,
        /// Height of the point, m.
        value: f64,
    },
    /// A solid of a rover that has no mirror image, or turns out of the plane.
    #[error(
        "model: {body} has no mirror image on the other side, or is rotated out of the plane; a planar model needs this symmetry"
    )]
    NotMirrored {
        /// Name of the body.
        body: String,
    },
}

impl PlanarError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            Self::Number(number) => number.field().to_owned(),
            Self::WheelsOverlap { .. } => "axle_b".to_owned(),
            Self::NotMirrored { .. } => "model".to_owned(),
            Self::TooFewPoints { .. } | Self::TooManyPoints { .. } => "x".to_owned(),
            Self::MismatchedLengths { .. } => "y".to_owned(),
            Self::NotAFunction { index, .. } => format!("x[{index}]"),
            Self::RepeatedPoint { index, .. } => format!("y[{index}]"),
        }
    }
}
