//! Readings: what a controller looks at, as one row of numbers with named places.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use rover_core::simulation::ReadingLayout;

use crate::arrays::{finite_shaped, two};
use crate::errors::{Kind, Result, Value};

/// Names with their slices.
pub fn slices<'py>(py: Python<'py>, layout: &ReadingLayout) -> Result<Bound<'py, PyDict>> {
    let names = PyDict::new(py);
    for (name, place) in layout.fields() {
        let (start, stop) = (place.start.cast_signed(), place.end.cast_signed());
        names.set_item(name, PySlice::new(py, start, stop, 1))?;
    }
    Ok(names)
}

/// Points (n, 2) of a height scan; none where nothing is given.
pub fn scan_points(given: Option<&Bound<'_, PyAny>>) -> Result<Vec<[f64; 2]>> {
    let Some(given) = given else {
        return Ok(Vec::new());
    };
    points(given, "scan")
}

/// Finite points (n, 2).
pub fn points(given: &Bound<'_, PyAny>, field: &str) -> Result<Vec<[f64; 2]>> {
    let fits = |shape: &[usize]| matches!(shape, [_, 2]);
    let (flat, _) = finite_shaped(given, Kind::Option, (field, "(n, 2)"), fits)?;
    Ok(flat.as_chunks::<2>().0.to_vec())
}

/// A finite place on the map; the origin where nothing is given.
pub fn place(target: Option<&Bound<'_, PyAny>>) -> Result<[f64; 2]> {
    let Some(given) = target else {
        return Ok([0.0; 2]);
    };
    let target = two(given, Kind::Option, "target")?;
    match target.iter().position(|x| !x.is_finite()) {
        None => Ok(target),
        Some(index) => {
            let value = target[index];
            let field = format!("target[{index}]");
            let message = format!("{field}: must be finite, is {value}");
            Err(Kind::Option.error(&field, message, Value::Number(value)))
        }
    }
}
