//! A friction-contact problem as users give it: `W` dense or sparse, `mu` one number or many.

use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rover_core::problem::{BlockSparseDelassus, Dimension, ProblemError};

use crate::arrays::{array, vector};
use crate::errors::{BorderError, Kind, Result, Value};

/// `W` as it was given.
pub enum Delassus {
    Dense(Vec<f64>),
    BlockSparse(BlockSparseDelassus),
}

impl Delassus {
    /// A square array, one of SciPy's sparse arrays, or block rows `(indptr, indices, data)`.
    pub fn read(W: &Bound<'_, PyAny>, dimension: Dimension) -> Result<Self> {
        let is_array = W.is_instance_of::<PyArrayDyn<f64>>();
        if !is_array && W.hasattr("tobsr")? {
            return Self::read_scipy(W, dimension);
        }
        if let Ok(rows) = W.cast::<PyTuple>()
            && rows.len() == 3
            && array(&rows.get_item(2)?, Kind::Problem, "W")?.shape().len() == 3
        {
            let index = |at: usize| -> Result<Vec<usize>> {
                let numbers = flat(&rows.get_item(at)?, "W")?;
                numbers.into_iter().map(as_index).collect()
            };
            let (starts, columns) = (index(0)?, index(1)?);
            let blocks = flat(&rows.get_item(2)?, "W")?;
            let sparse = BlockSparseDelassus::from_rows(dimension, starts, columns, blocks);
            return Ok(Self::BlockSparse(sparse?));
        }
        let dense = array(W, Kind::Problem, "W")?;
        let shape = dense.shape().to_vec();
        if shape.len() != 2 || shape[0] != shape[1] {
            let message = format!("W: must be square, has shape {shape:?}");
            let value = Value::Numbers(shape.iter().map(|&s| s as f64).collect());
            return Err(Kind::Problem.error("W", message, value));
        }
        Ok(Self::Dense(dense.as_array().iter().copied().collect()))
    }

    /// Reads a sparse array of SciPy's, which is not changed.
    fn read_scipy(W: &Bound<'_, PyAny>, dimension: Dimension) -> Result<Self> {
        let d = dimension.components();
        let shape: Vec<usize> = W.getattr("shape")?.extract()?;
        if shape.len() != 2 || shape[0] != shape[1] || !shape[0].is_multiple_of(d) {
            let message = format!("W: must be square with {d} rows a contact, has shape {shape:?}");
            let value = Value::Numbers(shape.iter().map(|&s| s as f64).collect());
            let message = if d == 3 && shape[0].is_multiple_of(2) {
                format!("{message}; contacts in the plane take dimension=2")
            } else {
                message
            };
            return Err(Kind::Problem.error("W", message, value));
        }
        let rows = W.call_method1("tocsr", (true,))?; // a copy, which may be rearranged
        rows.call_method0("sum_duplicates")?;
        let rows = rows.call_method1("tobsr", ((d, d),))?;
        rows.call_method0("sort_indices")?;
        let index = |name: &str| -> Result<Vec<usize>> {
            let numbers = flat(&rows.getattr(name)?, "W")?;
            numbers.into_iter().map(as_index).collect()
        };
        let (starts, columns) = (index("indptr")?, index("indices")?);
        let blocks = flat(&rows.getattr("data")?, "W")?;
        let sparse = BlockSparseDelassus::from_partial_rows(dimension, &starts, &columns, &blocks);
        Ok(Self::BlockSparse(sparse?))
    }
}

/// Friction coefficients, one for each contact or one for all.
pub fn coefficients(mu: &Bound<'_, PyAny>, n: usize, dimension: usize) -> Result<Vec<f64>> {
    let given = array(mu, Kind::Problem, "mu")?;
    if given.ndim() > 0 {
        return vector(mu, Kind::Problem, "mu");
    }
    if !n.is_multiple_of(dimension) {
        let other = 5 - dimension;
        let hint = if n.is_multiple_of(other) {
            format!("; contacts of {other} components take dimension={other}")
        } else {
            String::new()
        };
        let message = format!("q: has {n} entries, not {dimension} for each contact{hint}");
        return Err(Kind::Problem.error("q", message, Value::Count(n)));
    }
    Ok(vec![given.as_array().sum(); n / dimension])
}

/// The error of a problem whose sizes do not fit, with the dimension that would fit.
pub fn with_hint(error: ProblemError) -> BorderError {
    let ProblemError::VelocityShape {
        n_contacts,
        components,
        found,
    } = error
    else {
        return BorderError::from(error);
    };
    let other = 5 - components;
    let mut border = BorderError::from(error);
    if found == n_contacts * other {
        let hint = format!("; contacts of {other} components take dimension={other}");
        border.message.push_str(&hint);
    }
    border
}

/// Any array-like as a list, whatever its shape.
pub fn flat(value: &Bound<'_, PyAny>, field: &str) -> Result<Vec<f64>> {
    let numbers = array(value, Kind::Problem, field)?;
    Ok(numbers.as_array().iter().copied().collect())
}

fn as_index(number: f64) -> Result<usize> {
    if number >= 0.0 && number.fract() == 0.0 && number < 1e15 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked above
        return Ok(number as usize);
    }
    let message = format!("W: indices must be whole numbers >= 0, one is {number}");
    Err(Kind::Problem.error("W", message, Value::Number(number)))
}
