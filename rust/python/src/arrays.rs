//! Array-likes in, fresh arrays out.

use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::arguments::{number, refused, shown};
use crate::errors::{Kind, Result, Value};

/// Largest number of entries of a list, a nested list or a range. Each entry becomes a Python
/// object before NumPy makes an array of them.
const MOST_LISTED: usize = 1 << 24;

/// Deepest nesting whose entries are counted.
const DEPTH: usize = 4;

/// Refuses what is no array and states more than [`MOST_LISTED`] entries, before any of them is
/// read.
pub fn check_size(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<()> {
    let py = value.py();
    let is_array = value.hasattr("__array__")? || value.is_instance_of::<PyString>();
    let (mut count, mut entry) = (1_usize, Ok(value.clone()));
    for _ in 0..DEPTH {
        let length = match entry.as_ref().map(PyAnyMethods::len) {
            Ok(Ok(length)) => length,
            Ok(Err(error)) if error.is_instance_of::<PyOverflowError>(py) => usize::MAX,
            _ => break,
        };
        count = count.saturating_mul(length);
        entry = entry.and_then(|entry| entry.get_item(0));
    }
    if is_array || count <= MOST_LISTED {
        return Ok(());
    }
    let what = format!("an array, or at most {MOST_LISTED} numbers in lists");
    Err(refused(value, kind, field, &what))
}

/// Any array-like as float64 of any shape.
pub fn array<'py>(
    value: &Bound<'py, PyAny>,
    kind: Kind,
    field: &str,
) -> Result<PyReadonlyArrayDyn<'py, f64>> {
    if let Ok(ready) = value.cast::<PyArrayDyn<f64>>() {
        return Ok(ready.readonly());
    }
    let py = value.py();
    let refuse = |e: &PyErr| {
        kind.error(
            field,
            format!("{field}: must be an array of numbers ({})", e.value(py)),
            Value::Text(shown(value)),
        )
    };
    check_size(value, kind, field)?;
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
            .collect::<Result<_>>()?;
        PyArray1::from_vec(py, numbers).call_method1("reshape", (found.getattr("shape")?,))
    } else {
        return Err(refused(value, kind, field, "an array of numbers"));
    };
    let typed = converted
        .map_err(|e| refuse(&e))?
        .cast_into::<PyArrayDyn<f64>>()
        .map_err(PyErr::from)?;
    Ok(typed.readonly())
}

/// Any array-like of one dimension as a vector.
pub fn vector(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Vec<f64>> {
    if let Ok(ready) = value.extract::<PyReadonlyArray1<'_, f64>>() {
        return Ok(ready.as_array().to_vec());
    }
    let any = array(value, kind, field)?;
    let view = any.as_array();
    if view.ndim() != 1 {
        let message = format!("{field}: needs one dimension, has shape {:?}", view.shape());
        return Err(kind.error(field, message, Value::Count(view.ndim())));
    }
    Ok(view.iter().copied().collect())
}

/// Any array-like of one dimension as a vector of at most `n` entries: of more, none is read. Fewer
/// are for the caller to refuse.
pub fn at_most(value: &Bound<'_, PyAny>, n: usize, kind: Kind, field: &str) -> Result<Vec<f64>> {
    match value.len() {
        Ok(length) if length > n => Err(kind.error(
            field,
            format!("{field}: needs {n} entries, has {length}"),
            Value::Count(length),
        )),
        _ => vector(value, kind, field),
    }
}

/// Numbers of a shape that `fits`, row-major, with the shape; `what`: its name.
pub fn shaped(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    (field, what): (&str, &str),
    fits: impl Fn(&[usize]) -> bool,
) -> Result<(Vec<f64>, Vec<usize>)> {
    let any = array(value, kind, field)?;
    let view = any.as_array();
    if !fits(view.shape()) {
        let message = format!("{field}: needs shape {what}, has {:?}", view.shape());
        return Err(kind.error(field, message, Value::Count(view.ndim())));
    }
    Ok((view.iter().copied().collect(), view.shape().to_vec()))
}

/// Finite numbers of a shape that `fits`, as [`shaped`].
pub fn finite_shaped(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    (field, what): (&str, &str),
    fits: impl Fn(&[usize]) -> bool,
) -> Result<(Vec<f64>, Vec<usize>)> {
    let (values, shape) = shaped(value, kind, (field, what), fits)?;
    if let Some(x) = values.iter().find(|x| !x.is_finite()) {
        let message = format!("{field}: must be finite, has {x}");
        return Err(kind.error(field, message, Value::Number(*x)));
    }
    Ok((values, shape))
}

/// One number for both, or two.
pub fn one_or_two(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[f64; 2]> {
    if value.len().is_err() {
        return Ok([number(value, kind, field)?; 2]);
    }
    let values = vector(value, kind, field)?;
    let wrong = || refused(value, kind, field, "one number or two");
    <[f64; 2]>::try_from(values).map_err(|_| wrong())
}

/// N numbers.
fn entries<const N: usize>(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[f64; N]> {
    let values = vector(value, kind, field)?;
    <[f64; N]>::try_from(values.as_slice()).map_err(|_| {
        let message = format!("{field}: needs {N} entries, has {}", values.len());
        kind.error(field, message, Value::Count(values.len()))
    })
}

/// Two numbers.
pub fn two(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[f64; 2]> {
    entries(value, kind, field)
}

/// Three numbers.
pub fn triple(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[f64; 3]> {
    entries(value, kind, field)
}

/// Numbers on their way to Python, where they become a new array.
#[derive(Clone)]
pub struct Array<T = f64> {
    values: Vec<T>,
    shape: Vec<usize>,
}

impl<T> Array<T> {
    /// Row-major numbers, as many as the shape has entries.
    pub fn shaped(values: Vec<T>, shape: &[usize]) -> Self {
        let shape = shape.to_vec();
        Self { values, shape }
    }

    /// Entries along the first axis.
    pub fn len(&self) -> usize {
        self.shape[0]
    }

    /// All numbers in row-major order.
    pub fn values(&self) -> &[T] {
        &self.values
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(values: Vec<T>) -> Self {
        let shape = vec![values.len()];
        Self { values, shape }
    }
}

impl<T> FromIterator<T> for Array<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Vec::from_iter(values).into()
    }
}

impl<'py, T: Element + Clone> IntoPyObject<'py> for &Array<T> {
    type Target = PyArrayDyn<T>;
    type Output = Bound<'py, Self::Target>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        let array = PyArrayDyn::zeros(py, self.shape.clone(), false);
        array
            .readwrite()
            .as_slice_mut()?
            .clone_from_slice(&self.values);
        Ok(array)
    }
}

impl<'py, T: Element + Clone> IntoPyObject<'py> for Array<T> {
    type Target = PyArrayDyn<T>;
    type Output = Bound<'py, Self::Target>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        (&self).into_pyobject(py)
    }
}

/// New (n,) array.
pub fn fresh<T: Clone>(values: &[T]) -> Array<T> {
    values.to_vec().into()
}

/// New (n, M) array from rows.
pub fn fresh_rows<T, const M: usize>(rows: impl IntoIterator<Item = [T; M]>) -> Array<T> {
    let values: Vec<T> = rows.into_iter().flatten().collect();
    Array {
        shape: vec![values.len() / M, M],
        values,
    }
}

/// New (n, m) array from a nalgebra matrix.
pub fn fresh_matrix(m: &rover_core::nalgebra::DMatrix<f64>) -> Array {
    Array::shaped(m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])
}

/// (n, N) numbers of a terrain.
pub fn rows<const N: usize>(value: &Bound<'_, PyAny>, field: &str) -> Result<Vec<[f64; N]>> {
    let what = format!("(n, {N})");
    let (flat, _) = shaped(value, Kind::Terrain, (field, &what), |shape| {
        shape.contains(&0) || matches!(*shape, [_, n] if n == N)
    })?;
    Ok(flat.as_chunks::<N>().0.to_vec())
}
