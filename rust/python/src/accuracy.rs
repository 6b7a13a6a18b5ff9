//! `accuracy_options`: accuracy by request.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::Accuracy;

use crate::arguments::{Named, number, refused};
use crate::errors::{Kind, Result, Value};
use crate::options::{VARIANTS, name_of};

/// Accuracies by name.
pub const PRESETS: [(&str, Accuracy); 3] = [
    ("fast", Accuracy::FAST),
    ("balanced", Accuracy::BALANCED),
    ("reference", Accuracy::REFERENCE),
];

/// What an accuracy is, in words.
const WHAT: &str = "\"fast\", \"balanced\", \"reference\" or an error in metres";

/// Reads a preset's name or a target error in metres.
fn parse(given: &Bound<'_, PyAny>) -> Result<Accuracy> {
    if let Ok(name) = given.extract::<String>() {
        let found = PRESETS.iter().find(|(known, _)| *known == name);
        let unknown = || refused(given, Kind::Option, "accuracy", WHAT);
        return found.map(|(_, preset)| *preset).ok_or_else(unknown);
    }
    let Ok(metres) = number(given, Kind::Option, "accuracy") else {
        return Err(refused(given, Kind::Option, "accuracy", WHAT));
    };
    let too_fine = || {
        let least = Accuracy::FINEST;
        let what = format!("a number of metres not below {least:.1e}");
        refused(given, Kind::Option, "accuracy", &what)
    };
    Accuracy::for_error(metres).ok_or_else(too_fine)
}

/// The accuracy that was asked for among the options of `Simulation`, which then do not name what
/// it chooses.
pub fn chosen(given: &Named<'_>) -> Result<Accuracy> {
    let Some(accuracy) = given.some("accuracy")? else {
        return Ok(Accuracy::BALANCED);
    };
    for field in ["time_step", "variant", "tolerance"] {
        if given.some(field)?.is_some() {
            let message = format!("{field}: accuracy chooses it, so it cannot be given beside");
            return Err(Kind::Option.error(field, message, Value::Nothing));
        }
    }
    parse(&accuracy)
}

/// Options of `Simulation` for a given accuracy.
///
/// Args:
///     accuracy: "fast", "balanced" or "reference", or the error allowed on a path of 20 m on flat
///         ground, m.
///
/// Returns:
///     The keyword arguments `time_step` (s), `variant` and `tolerance`.
///
/// Raises:
///     OptionError: The name is unknown, or no options reach the given error.
#[pyfunction]
pub fn accuracy_options<'py>(
    py: Python<'py>,
    accuracy: &Bound<'py, PyAny>,
) -> Result<Bound<'py, PyDict>> {
    let chosen = parse(accuracy)?;
    let options = PyDict::new(py);
    options.set_item("time_step", chosen.time_step)?;
    options.set_item("variant", name_of(chosen.variant, &VARIANTS))?;
    options.set_item("tolerance", chosen.tolerance)?;
    Ok(options)
}
