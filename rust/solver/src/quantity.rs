//! Checks of the numbers of a description: finite, of the right sign, within a range in which the
//! mechanics neither overflows nor underflows.

use thiserror::Error;

/// An inadmissible number.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum QuantityError {
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
    /// So large or so small that the mechanics would overflow or underflow.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the argument.
        field: String,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
}

impl QuantityError {
    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> &str {
        match self {
            Self::NotFinite { field, .. }
            | Self::NotPositive { field, .. }
            | Self::Negative { field, .. }
            | Self::OutOfRange { field, .. } => field,
        }
    }

    /// What was given.
    #[must_use]
    pub fn value(&self) -> f64 {
        match self {
            Self::NotFinite { value, .. }
            | Self::NotPositive { value, .. }
            | Self::Negative { value, .. }
            | Self::OutOfRange { value, .. } => *value,
        }
    }
}

/// `value`, if it is finite.
///
/// # Errors
/// [`QuantityError::NotFinite`].
pub fn finite(field: &str, value: f64) -> Result<f64, QuantityError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(QuantityError::NotFinite {
            field: field.to_owned(),
            value,
        })
    }
}

/// `value`, if it is finite and positive.
///
/// # Errors
/// [`QuantityError::NotFinite`] or [`QuantityError::NotPositive`].
pub fn positive(field: &str, value: f64) -> Result<f64, QuantityError> {
    if finite(field, value)? > 0.0 {
        Ok(value)
    } else {
        Err(QuantityError::NotPositive {
            field: field.to_owned(),
            value,
        })
    }
}

/// Admissible numbers of an argument, with their description in words.
#[derive(Clone, Copy, Debug)]
pub struct AdmissibleRange {
    /// Smallest and largest size; either sign where the smallest is negative.
    pub ends: [f64; 2],
    /// In words.
    pub words: &'static str,
}

/// Masses, kg.
pub const MASSES: AdmissibleRange = AdmissibleRange {
    ends: [1e-9, 1e12],
    words: "from 1e-9 to 1e12 kg",
};

/// Lengths, m.
pub const LENGTHS: AdmissibleRange = AdmissibleRange {
    ends: [1e-6, 1e6],
    words: "from 1e-6 to 1e6 m",
};

/// Inertias, kg m².
pub const INERTIAS: AdmissibleRange = AdmissibleRange {
    ends: [1e-24, 1e24],
    words: "from 1e-24 to 1e24 kg m²",
};

/// Places, m.
pub const PLACES: AdmissibleRange = AdmissibleRange {
    ends: [-1e6, 1e6],
    words: "at most 1e6 m either way",
};

/// `value`, if it is within a range; positive where the range is. `field`: its name.
///
/// # Errors
/// [`QuantityError::NotFinite`], [`QuantityError::NotPositive`] or [`QuantityError::OutOfRange`].
pub fn within(
    field: impl Fn() -> String,
    value: f64,
    range: AdmissibleRange,
) -> Result<f64, QuantityError> {
    let AdmissibleRange {
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
    Err(QuantityError::OutOfRange {
        field: field(),
        range: words,
        value,
    })
}

/// Longest number that a message writes out: a double with all its digits is no longer.
const MOST_DIGITS: usize = 24;

/// A message whose long numbers have an exponent: `1e300` instead of 301 digits.
#[must_use]
pub fn legible(message: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let mut written = String::with_capacity(message.len());
    let mut rest = message;
    while let Some(begin) = rest.find(is_part) {
        let (before, from) = rest.split_at(begin);
        let (number, after) = from.split_at(from.find(|c: char| !is_part(c)).unwrap_or(from.len()));
        written.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if number.len() > MOST_DIGITS => written = format!("{written}{value:?}"),
            _ => written.push_str(number),
        }
        rest = after;
    }
    written + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_number_is_written_with_an_exponent() {
        let large = format!("speed: is {}, not 3.5 m", -1e300);
        assert_eq!(legible(&large), "speed: is -1e300, not 3.5 m");
        assert_eq!(legible(&format!("is {}", 1e-300)), "is 1e-300");
        let short = "1.2.3 of 0.30000000000000004.";
        assert_eq!(legible(short), short);
    }
}
