//! Checks of single values: numbers, positions, directions, names of materials.

use nalgebra::{Unit, Vector3};

use crate::law::materials::is_name;
use crate::multibody::error::{ModelError, ModelFault};

/// Largest magnitude of a length in a description, m.
const MAX_LENGTH: f64 = 1e6;

/// Checks that a value is within its range, which words name.
pub(in crate::multibody) fn within(
    is_within: bool,
    field: &str,
    value: f64,
    range: &'static str,
) -> Result<(), ModelError> {
    if is_within {
        return Ok(());
    }
    Err(ModelFault::OutOfRange { range, value }.at(field))
}

/// Checks that a value is finite and at most `limit` in magnitude.
pub(in crate::multibody) fn in_range(
    field: &str,
    value: f64,
    limit: f64,
    range: &'static str,
) -> Result<(), ModelError> {
    finite(field, &[value])?;
    within(value.abs() <= limit, field, value, range)
}

/// Checks a positive length, m.
pub(in crate::multibody) fn length(field: &str, value: f64) -> Result<(), ModelError> {
    positive(field, value)?;
    let is_within = (1e-6..=MAX_LENGTH).contains(&value);
    within(is_within, field, value, "from 1e-6 to 1e6 m")
}

/// Checks a position, m.
pub(super) fn place(field: &str, values: &[f64; 3]) -> Result<(), ModelError> {
    (values.iter()).try_for_each(|&x| in_range(field, x, MAX_LENGTH, "at most 1e6 m either way"))
}

/// Checks a gain, a torque or an inertia: not negative, and small enough for double precision
/// throughout a step.
pub(super) fn moderate(field: &str, value: f64) -> Result<(), ModelError> {
    not_negative(field, value)?;
    in_range(field, value, 1e18, "at most 1e18")
}

pub(super) fn finite(field: &str, values: &[f64]) -> Result<(), ModelError> {
    values.iter().try_for_each(|&value| {
        if value.is_finite() {
            Ok(())
        } else {
            Err(ModelFault::NotFinite(value).at(field))
        }
    })
}

pub(super) fn positive(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value > 0.0 {
        Ok(())
    } else {
        Err(ModelFault::NotPositive(value).at(field))
    }
}

pub(super) fn not_negative(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value >= 0.0 {
        Ok(())
    } else {
        Err(ModelFault::Negative(value).at(field))
    }
}

/// Checks the name of a material.
pub(super) fn material(field: &str, name: Option<&String>) -> Result<(), ModelError> {
    match name.filter(|name| !is_name(name)) {
        Some(name) => Err(ModelFault::MaterialName(name.clone()).at(field)),
        None => Ok(()),
    }
}

pub(super) fn direction(field: &str, value: [f64; 3]) -> Result<(), ModelError> {
    finite(field, &value)?;
    if Unit::try_new(Vector3::from(value), 1e-9).is_some() {
        Ok(())
    } else {
        Err(ModelFault::NoDirection(value).at(field))
    }
}
