//! Array-likes in, fresh arrays out.

use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn,
};
use pyo3::prelude::*;

use crate::arguments::{number, refused, shown};
use crate::errors::{BorderError, Kind, Value};

/// Any array-like as float64 of any shape.
pub fn array<'py>(
    value: &Bound<'py, PyAny>,
    kind: Kind,
    field: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = value.py();
    let refuse = |e: &PyErr| BorderError {
        kind,
        message: format!("{field}: must be an array of numbers ({})", e.value(py)),
        field: Some(field.to_owned()),
        value: Value::Text(shown(value)),
    };
    let numpy = py.import("numpy")?;
    let found = numpy
        .call_method1("asarray", (value,))
        .map_err(|e| refuse(&e))?;
    // numpy would also take truth values, texts, times, and the real part of a complex number.
    // Python objects, such as fractions, are converted one by one.
    let letter: char = found.getattr("dtype")?.getattr("kind")?.extract()?;
    let is_empty = found.len().unwrap_or(1) == 0;
    let converted = if "fiu".contains(letter) || is_empty {
        numpy.call_method1("asarray", (&found, "float64"))
    } else if letter == 'O' {
        let numbers: Vec<f64> = found
            .getattr("flat")?
            .try_iter()?
            .map(|entry| number(&entry?, kind, field))
            .collect::<PyResult<_>>()?;
        PyArray1::from_vec(py, numbers).call_method1("reshape", (found.getattr("shape")?,))
    } else {
        return Err(refused(value, kind, field, "an array of numbers").into());
    };
    let typed = converted
        .map_err(|e| refuse(&e))?
        .cast_into::<PyArrayDyn<f64>>()?;
    Ok(typed.readonly())
}

/// Any array-like of one dimension as a vector.
pub fn vector(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<Vec<f64>> {
    if let Ok(ready) = value.extract::<PyReadonlyArray1<'_, f64>>() {
        return Ok(ready.as_array().to_vec());
    }
    let any = array(value, kind, field)?;
    let view = any.as_array();
    if view.ndim() != 1 {
        let message = format!("{field}: needs one dimension, has shape {:?}", view.shape());
        return Err(BorderError {
            kind,
            message,
            field: Some(field.to_owned()),
            value: Value::Count(view.ndim()),
        }
        .into());
    }
    Ok(view.iter().copied().collect())
}

/// One number for both, or two.
pub fn one_or_two(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<[f64; 2]> {
    if value.len().is_err() {
        return Ok([number(value, kind, field)?; 2]);
    }
    let values = vector(value, kind, field)?;
    let wrong = || refused(value, kind, field, "one number or two");
    Ok(<[f64; 2]>::try_from(values).map_err(|_| wrong())?)
}

/// Two numbers.
pub fn two(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<[f64; 2]> {
    let values = vector(value, kind, field)?;
    let wrong = || refused(value, kind, field, "two numbers");
    Ok(<[f64; 2]>::try_from(values).map_err(|_| wrong())?)
}

/// Three numbers.
pub fn triple(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<[f64; 3]> {
    let values = vector(value, kind, field)?;
    <[f64; 3]>::try_from(values.as_slice()).map_err(|_| {
        let message = format!("{field}: needs 3 entries, has {}", values.len());
        BorderError {
            kind,
            message,
            field: Some(field.to_owned()),
            value: Value::Count(values.len()),
        }
        .into()
    })
}

/// Fresh (n,) array.
pub fn fresh<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, values)
}

/// Fresh (n, m) array from rows.
pub fn fresh_rows<'py, const M: usize>(
    py: Python<'py>,
    rows: &[[f64; M]],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_iter(py, rows.iter().flatten().copied()).reshape([rows.len(), M])
}

/// Fresh (n, a, b) array from a row-major list.
pub fn fresh_blocks(
    py: Python<'_>,
    values: Vec<f64>,
    shape: [usize; 3],
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// Fresh (n, n) array from a nalgebra matrix.
pub fn fresh_matrix<'py>(
    py: Python<'py>,
    m: &rover_core::nalgebra::DMatrix<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (rows, columns) = m.shape();
    let transposed = m.transpose();
    PyArray1::from_slice(py, transposed.as_slice()).reshape([rows, columns])
}

/// Fresh (m, M) array of any type.
pub fn fresh_table<T: numpy::Element, const M: usize>(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = [T; M]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let m = rows.len();
    PyArray1::from_iter(py, rows.flatten()).reshape([m, M])
}

/// (n, N) numbers of a terrain.
pub fn rows<const N: usize>(value: &Bound<'_, PyAny>, field: &str) -> PyResult<Vec<[f64; N]>> {
    let given = array(value, Kind::Terrain, field)?;
    let view = given.as_array();
    let is_empty = view.is_empty();
    if !is_empty && (view.ndim() != 2 || view.shape()[1] != N) {
        let message = format!("{field}: needs shape (n, {N}), has {:?}", view.shape());
        let (name, value) = (Some(field.to_owned()), Value::Count(view.ndim()));
        return Err(BorderError {
            kind: Kind::Terrain,
            message,
            field: name,
            value,
        }
        .into());
    }
    let flat: Vec<f64> = view.iter().copied().collect();
    Ok(flat
        .chunks_exact(N)
        .map(|row| std::array::from_fn(|k| row[k]))
        .collect())
}
