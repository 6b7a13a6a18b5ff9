//! Files of other programs: what reads and writes them is Python, in `rover_gym.models`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::arguments::Given;
use crate::model::RoverModel;

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

/// The model and the report that a reader of the room returns.
pub fn read<'py>(
    reader: &str,
    path: &Bound<'py, PyAny>,
    options: Options<'py>,
) -> PyResult<RoverModel> {
    let py = path.py();
    let room = py.import(ROOM)?;
    let found = room.call_method(reader, (path,), Some(&keywords(py, options)?))?;
    let (model, report): (RoverModel, Py<PyAny>) = found.extract()?;
    Ok(RoverModel {
        inner: model.inner,
        report: Some(Arc::new(report)),
    })
}

/// Calls a writer of the room.
pub fn write<'py>(
    writer: &str,
    model: RoverModel,
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
