//! Limits of the numbers that describe a ground.

use super::error::TerrainError;

/// Most spheres of a field: some hundred megabytes, and a second to sort them.
pub const MAX_SPHERES: usize = 2_000_000;

/// Largest coordinate, height and radius, m: a double still resolves a nanometre there.
pub const MAX_SIZE: f64 = 1e6;

/// Refuses more than [`MAX_SPHERES`] spheres.
pub(super) fn check_count(count: usize) -> Result<(), TerrainError> {
    if count > MAX_SPHERES {
        return Err(TerrainError::TooMany {
            count,
            limit: MAX_SPHERES,
        });
    }
    Ok(())
}

/// Refuses an entry of an array that is not finite or beyond [`MAX_SIZE`].
pub(super) fn check_entry(
    field: &'static str,
    index: usize,
    value: f64,
) -> Result<(), TerrainError> {
    if !value.is_finite() {
        return Err(TerrainError::EntryNotFinite {
            field,
            index,
            value,
        });
    }
    if value.abs() > MAX_SIZE {
        return Err(TerrainError::TooFar {
            field,
            index,
            value,
            limit: MAX_SIZE,
        });
    }
    Ok(())
}
