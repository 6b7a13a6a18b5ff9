//! Heights of a terrain as an array.

use numpy::PyArray1;
use pyo3::prelude::*;
use rover_core::geometry::Terrain;

use crate::arrays::{fresh, rows};

/// Heights of a terrain's visible surface at places (m, 2); nan where there is none.
pub fn heights<'py>(
    terrain: &dyn Terrain,
    py: Python<'py>,
    points: &Bound<'_, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = rows::<2>(points, "points")?;
    let heights: Vec<f64> = points
        .iter()
        .map(|&[x, z]| terrain.height(x, z).unwrap_or(f64::NAN))
        .collect();
    Ok(fresh(py, &heights))
}
