//! `sin_cos`, `atan2` and `exp`: elementary functions of numbers and arrays with the same bits
//! everywhere.

use numpy::ndarray::{ArrayD, ArrayViewD, Zip};
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use rover_core::scalar::elementary;

use crate::arrays::array;
use crate::errors::{Kind, Result, Value};

/// Sine and cosine of angles.
///
/// Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
/// are accurate to 1 ulp. Infinite and NaN arguments give NaN.
///
/// Args:
///     x: An angle, or an array of any shape, rad.
///
/// Returns:
///     Sine and cosine: two numbers, or two new arrays of the shape of x.
///
/// Raises:
///     OptionError: x is neither a number nor an array of numbers.
#[pyfunction]
pub fn sin_cos<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    if let Ok(x) = x.cast::<PyFloat>() {
        let (sin, cos) = elementary::sin_cos(x.value());
        return Ok((
            PyFloat::new(py, sin).into_any(),
            PyFloat::new(py, cos).into_any(),
        ));
    }
    let given = array(x, Kind::Option, "x")?;
    let x = given.as_array();
    let (mut sin, mut cos) = (ArrayD::zeros(x.raw_dim()), ArrayD::zeros(x.raw_dim()));
    Zip::from(&mut sin)
        .and(&mut cos)
        .and(&x)
        .for_each(|sin, cos, x| (*sin, *cos) = elementary::sin_cos(*x));
    Ok((fresh(py, sin), fresh(py, cos)))
}

/// Polar angles of the points (x, y), in [-pi, pi].
///
/// Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
/// are accurate to 1 ulp.
///
/// Args:
///     y: A number or an array of any shape.
///     x: The same; the two shapes must be equal.
///
/// Returns:
///     The angle, rad: a number, or a new array.
///
/// Raises:
///     OptionError: An argument is neither a number nor an array of numbers, or the shapes differ.
#[pyfunction]
pub fn atan2<'py>(
    py: Python<'py>,
    y: &Bound<'py, PyAny>,
    x: &Bound<'py, PyAny>,
) -> Result<Bound<'py, PyAny>> {
    if let (Ok(y), Ok(x)) = (y.cast::<PyFloat>(), x.cast::<PyFloat>()) {
        return Ok(PyFloat::new(py, elementary::atan2(y.value(), x.value())).into_any());
    }
    let given: [PyReadonlyArrayDyn<'py, f64>; 2] =
        [array(y, Kind::Option, "y")?, array(x, Kind::Option, "x")?];
    let [y, x]: [ArrayViewD<'_, f64>; 2] = [given[0].as_array(), given[1].as_array()];
    if x.shape() != y.shape() {
        let message = format!("x: shape {:?}, but y has {:?}", x.shape(), y.shape());
        return Err(Kind::Option.error("x", message, Value::Count(x.len())));
    }
    let angle = Zip::from(&y)
        .and(&x)
        .map_collect(|y, x| elementary::atan2(*y, *x));
    Ok(fresh(py, angle))
}

/// Exponentials.
///
/// Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
/// are accurate to 1 ulp.
///
/// Args:
///     x: A number or an array of any shape.
///
/// Returns:
///     The exponential: a number, or a new array of the shape of x.
///
/// Raises:
///     OptionError: x is neither a number nor an array of numbers.
#[pyfunction]
pub fn exp<'py>(py: Python<'py>, x: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>> {
    if let Ok(x) = x.cast::<PyFloat>() {
        return Ok(PyFloat::new(py, elementary::exp(x.value())).into_any());
    }
    let given = array(x, Kind::Option, "x")?;
    Ok(fresh(py, given.as_array().mapv(elementary::exp)))
}

fn fresh(py: Python<'_>, values: ArrayD<f64>) -> Bound<'_, PyAny> {
    PyArrayDyn::from_owned_array(py, values).into_any()
}
