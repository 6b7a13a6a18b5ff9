//! `Machine`: what belongs to one of several machines.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PySlice};
use rover_core::multibody::{LoopDescription, Model, ModelDescription};
use std::ops::Range;

use crate::errors::{Kind, Result, Value};

/// A machine of a model, with its slices of the model's arrays.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct Machine {
    /// Name of the machine.
    name: String,
    /// Names of the machine's solids.
    solids: Vec<String>,
    /// The machine's slice of coordinates and velocities, such as `Simulation.q`.
    coordinates: Py<PySlice>,
    /// The machine's slice of arrays with one entry a joint.
    joints: Py<PySlice>,
    /// The machine's slice of arrays with one entry a wheel, such as `Simulation.wheel_forces`.
    wheels: Py<PySlice>,
}

#[pymethods]
impl Machine {
    fn __repr__(&self, py: Python<'_>) -> String {
        let coordinates = self.coordinates.bind(py);
        format!("Machine({:?}, coordinates={coordinates})", self.name)
    }
}

/// The machines of a model, by name.
pub fn by_name<'py>(py: Python<'py>, model: &Model) -> Result<Bound<'py, PyDict>> {
    let part = |range: &Range<usize>| {
        PySlice::new(py, range.start.cast_signed(), range.end.cast_signed(), 1).unbind()
    };
    let machines = PyDict::new(py);
    for own in model.machines() {
        let frames = &model.frames()[own.solids.clone()];
        let machine = Machine {
            name: own.name.clone(),
            solids: frames.iter().map(|frame| frame.name.clone()).collect(),
            coordinates: part(&own.velocities),
            joints: part(&own.joints),
            wheels: part(&own.wheels),
        };
        machines.set_item(&own.name, Py::new(py, machine)?)?;
    }
    Ok(machines)
}

/// Refuses what cannot be put on its wheels as a whole.
pub fn check_standing(model: &Model) -> Result<()> {
    let (n_machines, n_wheels) = (model.machines().len(), model.wheels().len());
    if n_machines > 1 {
        let message = format!(
            "machines: places one machine, the model has {n_machines}; place each by its own model \
             and join the coordinates with numpy.concatenate"
        );
        return Err(Kind::Model.error("machines", message, Value::Count(n_machines)));
    }
    if n_wheels == 0 {
        let message = "wheels: a model without wheels cannot stand on them".to_owned();
        return Err(Kind::Model.error("wheels", message, Value::Count(0)));
    }
    Ok(())
}

/// Loops from dictionaries as in a model file.
pub fn read_loops(loops: &Bound<'_, PyAny>) -> Result<Vec<LoopDescription>> {
    let py = loops.py();
    let listed = || -> PyResult<String> {
        let loops = PyList::new(py, loops.try_iter()?.collect::<PyResult<Vec<_>>>()?)?;
        py.import("json")?
            .call_method1("dumps", (loops,))?
            .extract()
    };
    let listed = listed().map_err(|e| {
        let message = format!("loops: must be a list of dictionaries: {}", e.value(py));
        Kind::Model.error("loops", message, Value::Nothing)
    })?;
    let text = format!(r#"{{"name": "", "solids": [], "loops": {listed}}}"#);
    Ok(ModelDescription::from_json(&text)?.loops)
}
