//! Checks of the numbers of a soil.

use friction_contact::quantity::{QuantityError, finite};

/// Checks a number against a closed range.
pub(crate) fn in_range(
    field: &str,
    value: f64,
    [low, high]: [f64; 2],
    range: &'static str,
) -> Result<(), QuantityError> {
    finite(field, value)?;
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(QuantityError::OutOfRange {
            field: field.to_owned(),
            range,
            value,
        })
    }
}

/// Checks that a number is finite and not negative.
pub(crate) fn not_negative(field: &str, value: f64) -> Result<(), QuantityError> {
    if finite(field, value)? < 0.0 {
        return Err(QuantityError::Negative {
            field: field.to_owned(),
            value,
        });
    }
    Ok(())
}
