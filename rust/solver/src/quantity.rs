//! Checks of the numbers of a description: finite, of the right sign, within a range in which the
//! mechanics neither overflows nor underflows.

use thiserror::Error;

/// An inadmissible number.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{field}: must {demand}, is {value}")]
pub struct QuantityError {
    field: String,
    demand: Demand,
    value: f64,
}

/// What a number must be.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Demand {
    /// Neither NaN nor infinite.
    #[error("be finite")]
    Finite,
    /// Neither zero nor negative.
    #[error("be positive")]
    Positive,
    /// Zero or positive.
    #[error("not be negative")]
    NotNegative,
    /// Neither so large nor so small that the mechanics would overflow or underflow: within this
    /// range, in words.
    #[error("be {0}")]
    Within(&'static str),
}

impl QuantityError {
    /// An argument's `value` that does not meet a demand.
    #[must_use]
    pub fn new(field: impl Into<String>, demand: Demand, value: f64) -> Self {
        Self {
            field: field.into(),
            demand,
            value,
        }
    }

    /// Name of the argument that is wrong.
    #[must_use]
    pub fn field(&self) -> &str {
        &self.field
    }

    /// What was given.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }
}

/// `value`, if `meets` says that it meets a demand.
fn checked(meets: bool, field: &str, demand: Demand, value: f64) -> Result<f64, QuantityError> {
    meets
        .then_some(value)
        .ok_or_else(|| QuantityError::new(field, demand, value))
}

/// `value`, if it is finite.
///
/// # Errors
/// NaN or infinite.
pub fn finite(field: &str, value: f64) -> Result<f64, QuantityError> {
    checked(value.is_finite(), field, Demand::Finite, value)
}

/// `value`, if it is finite and positive.
///
/// # Errors
/// Not finite, zero or negative.
pub fn positive(field: &str, value: f64) -> Result<f64, QuantityError> {
    checked(finite(field, value)? > 0.0, field, Demand::Positive, value)
}

/// `value`, if it is finite and not negative.
///
/// # Errors
/// Not finite, or negative.
pub fn not_negative(field: &str, value: f64) -> Result<f64, QuantityError> {
    checked(
        finite(field, value)? >= 0.0,
        field,
        Demand::NotNegative,
        value,
    )
}

/// `value`, if it is finite and between two ends; `range` says so in words.
///
/// # Errors
/// Not finite, or beyond the ends.
pub fn between(
    field: &str,
    value: f64,
    [low, high]: [f64; 2],
    range: &'static str,
) -> Result<f64, QuantityError> {
    let value = finite(field, value)?;
    checked(
        (low..=high).contains(&value),
        field,
        Demand::Within(range),
        value,
    )
}

/// Admissible numbers of an argument, with their description in words.
#[derive(Clone, Copy, Debug)]
pub struct AdmissibleRange {
    /// Smallest and largest size; either sign where the smallest is negative.
    pub ends: [f64; 2],
    /// In words.
    pub words: &'static str,
}

impl AdmissibleRange {
    /// From the smallest to the largest size, with its description in words.
    #[must_use]
    pub const fn new(ends: [f64; 2], words: &'static str) -> Self {
        Self { ends, words }
    }
}

/// Masses, kg.
pub const MASSES: AdmissibleRange = AdmissibleRange::new([1e-9, 1e12], "from 1e-9 to 1e12 kg");

/// Lengths, m.
pub const LENGTHS: AdmissibleRange = AdmissibleRange::new([1e-6, 1e6], "from 1e-6 to 1e6 m");

/// Inertias, kg m².
pub const INERTIAS: AdmissibleRange =
    AdmissibleRange::new([1e-24, 1e24], "from 1e-24 to 1e24 kg m²");

/// Places, m.
pub const PLACES: AdmissibleRange = AdmissibleRange::new([-1e6, 1e6], "at most 1e6 m either way");

/// `value`, if it is within a range; positive where the range is. `field`: its name.
///
/// # Errors
/// Not finite, not positive, or out of the range.
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
    Err(QuantityError::new(field(), Demand::Within(words), value))
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
