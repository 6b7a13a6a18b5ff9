//! `accuracy_options`: accuracy by request.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::Accuracy;

use crate::errors::{BorderError, Value};
use crate::simulation::{VARIANTS, name_of};

const PRESETS: [(&str, Accuracy); 3] = [
    ("fast", Accuracy::FAST),
    ("balanced", Accuracy::BALANCED),
    ("reference", Accuracy::REFERENCE),
];

/// Reads a preset's name or a target error in metres.
pub fn parse(given: &Bound<'_, PyAny>) -> Result<Accuracy, BorderError> {
    let refused = |message: String, value| BorderError::option("accuracy", message, value);
    if let Ok(name) = given.extract::<String>() {
        let found = PRESETS.iter().find(|(known, _)| *known == name);
        return found.map(|(_, preset)| *preset).ok_or_else(|| {
            let message = format!(
                "accuracy: must be \"fast\", \"balanced\", \"reference\" or an error in metres, is {name:?}"
            );
            refused(message, Value::Text(name))
        });
    }
    let Ok(metres) = given.extract::<f64>() else {
        let message =
            "accuracy: must be \"fast\", \"balanced\", \"reference\" or an error in metres";
        return Err(refused(message.to_owned(), Value::Nothing));
    };
    Accuracy::for_error(metres).ok_or_else(|| {
        let message = format!(
            "accuracy: an error must be a number of metres not below {:.1e}, is {metres}",
            Accuracy::FINEST
        );
        refused(message, Value::Number(metres))
    })
}

/// The keyword arguments `time_step`, `variant` and `tolerance` of `Simulation` that an accuracy stands for.
#[pyfunction]
pub fn accuracy_options<'py>(
    py: Python<'py>,
    accuracy: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let chosen = parse(accuracy)?;
    let options = PyDict::new(py);
    options.set_item("time_step", chosen.time_step)?;
    options.set_item("variant", name_of(chosen.variant, &VARIANTS))?;
    options.set_item("tolerance", chosen.tolerance)?;
    Ok(options)
}
