//! Files of other programs: what reads and writes them is Python, in `rover_gym.models`.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::arguments::Given;

const ROOM: &str = "rover_gym.models";

/// Options of a reader, as they were given.
pub type Options<'py> = Vec<(&'static str, Given<'py>)>;

fn keywords<'py>(py: Python<'py>, options: Options<'py>) -> PyResult<Bound<'py, PyDict>> {
    let given = PyDict::new(py);
    for (name, value) in options {
        if let Some(value) = value.given() {
            given.set_item(name, value)?;
        }
    }
    Ok(given)
}

/// What a reader of the room returns: a model and the report of its import.
pub fn read<'py>(
    reader: &str,
    path: &Bound<'py, PyAny>,
    options: Options<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = path.py();
    let room = py.import(ROOM)?;
    room.call_method(reader, (path,), Some(&keywords(py, options)?))
}

/// Calls a writer of the room.
pub fn write<'py>(
    writer: &str,
    model: Bound<'py, PyAny>,
    path: &Bound<'py, PyAny>,
    options: Options<'py>,
) -> PyResult<()> {
    let py = path.py();
    let writer = PyString::new(py, writer);
    let arguments = (model, path.clone());
    py.import(ROOM)?
        .call_method(writer, arguments, Some(&keywords(py, options)?))?;
    Ok(())
}
