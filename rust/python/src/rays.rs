//! Rays as arrays, and what they meet as arrays.

use pyo3::prelude::*;
use rover_core::geometry::RayError;
use rover_core::geometry::ray::{Hit, Ray, check_rays};

use crate::arguments::Given;
use crate::arrays::{Array, fresh_rows, shaped};
use crate::errors::{BorderError, Kind, Result, Value, entry};

/// Distances (n,) and normals (n, 3).
pub type Met = (Array, Array);

impl From<RayError> for BorderError {
    fn from(e: RayError) -> Self {
        let (index, value) = match &e {
            RayError::MismatchedLengths { directions, .. } => (None, Value::Count(*directions)),
            RayError::NotFinite { index, value, .. } | RayError::TooFar { index, value, .. } => {
                (Some(index), Value::Number(*value))
            }
            RayError::NoDirection { index } => (Some(index), Value::Numbers(vec![0.0; 3])),
            RayError::BadRange { value } => (None, Value::Number(*value)),
        };
        Kind::Option.error(entry(e.field(), index), e.to_string(), value)
    }
}

/// (n, 3) numbers, or (3,) for all rays.
fn triples(value: &Bound<'_, PyAny>, field: &str) -> Result<(Vec<[f64; 3]>, bool)> {
    let what = (field, "(n, 3) or (3,)");
    let fits = |shape: &[usize]| matches!(shape, [3] | [_, 3]);
    let (flat, shape) = shaped(value, Kind::Option, what, fits)?;
    Ok((flat.as_chunks::<3>().0.to_vec(), shape == [3]))
}

/// Checked rays, and their range, m.
pub fn rays(
    origins: &Bound<'_, PyAny>,
    directions: &Bound<'_, PyAny>,
    max_range: Given<'_>,
) -> Result<(Vec<Ray>, f64)> {
    let (mut origins, has_one_origin) = triples(origins, "origins")?;
    let (mut directions, has_one_direction) = triples(directions, "directions")?;
    if has_one_origin && !has_one_direction {
        origins = vec![origins[0]; directions.len()];
    } else if has_one_direction && !has_one_origin {
        directions = vec![directions[0]; origins.len()];
    }
    let range = max_range
        .maybe(Kind::Option, "max_range")?
        .unwrap_or(f64::INFINITY);
    let rays = check_rays(&origins, &directions, range)?;
    Ok((rays, range))
}

/// Hits as arrays: infinite distances and NaN normals for rays without a hit.
pub fn met(hits: &[Option<Hit>]) -> Met {
    let distance = |hit: &Option<Hit>| hit.map_or(f64::INFINITY, |hit| hit.distance);
    let normal = |hit: &Option<Hit>| hit.map_or([f64::NAN; 3], |hit| hit.normal.into());
    (
        hits.iter().map(distance).collect(),
        fresh_rows(hits.iter().map(normal)),
    )
}
