//! Checks of single values: numbers, positions, directions, names of materials.

use nalgebra::{Unit, Vector3};

use crate::law::materials::is_name;
use crate::multibody::error::ModelError;

/// Largest magnitude of a length in a description, m.
const MAX_LENGTH: f64 = 1e6;

/// Checks that a value is finite and at most `limit` in magnitude.
pub(in crate::multibody) fn in_range(
    field: &str,
    value: f64,
    limit: f64,
    range: &'static str,
) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value.abs() <= limit {
        return Ok(());
    }
    Err(ModelError::OutOfRange {
        field: field.to_owned(),
        range,
        value,
    })
}

/// Checks a positive length, m.
pub(in crate::multibody) fn length(field: &str, value: f64) -> Result<(), ModelError> {
    positive(field, value)?;
    if (1e-6..=MAX_LENGTH).contains(&value) {
        return Ok(());
    }
    Err(ModelError::OutOfRange {
        field: field.to_owned(),
        range: "from 1e-6 to 1e6 m",
        value,
    })
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
            Err(ModelError::NotFinite {
                field: field.to_owned(),
                value,
            })
        }
    })
}

pub(super) fn positive(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value > 0.0 {
        Ok(())
    } else {
        Err(ModelError::NotPositive {
            field: field.to_owned(),
            value,
        })
    }
}

pub(super) fn not_negative(field: &str, value: f64) -> Result<(), ModelError> {
    finite(field, &[value])?;
    if value >= 0.0 {
        Ok(())
    } else {
        Err(ModelError::Negative {
            field: field.to_owned(),
            value,
        })
    }
}

/// Checks the name of a material.
pub(super) fn material(field: &str, name: Option<&String>) -> Result<(), ModelError> {
    match name.filter(|name| !is_name(name)) {
        Some(name) => Err(ModelError::MaterialName {
            field: field.to_owned(),
            name: name.clone(),
        }),
        None => Ok(()),
    }
}

pub(super) fn direction(field: &str, value: [f64; 3]) -> Result<(), ModelError> {
    finite(field, &value)?;
    if Unit::try_new(Vector3::from(value), 1e-9).is_some() {
        Ok(())
    } else {
        Err(ModelError::NoDirection {
            field: field.to_owned(),
            value,
        })
    }
}
