//! Signatures of the classes that take options, and types for the writer of the stub.

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyType};

use crate::accuracy::PRESETS;
use crate::balls::GrainSimulation;
use crate::bed_options;
use crate::disks::DiskSimulation;
use crate::options::{Described, METHODS, described_steps, literal};
use crate::planar::RULES;
use crate::planar_machines::{BallSimulation, MirroredRoverSimulation, TwoWheelRoverSimulation};
use crate::simulation::Simulation;

/// Puts options into the signature of a class, after its gravity, and returns their types by name.
fn sign<'py>(class: &Bound<'py, PyType>, options: &[Described]) -> PyResult<Bound<'py, PyDict>> {
    let py = class.py();
    let inspect = py.import("inspect")?;
    let parameter = inspect.getattr("Parameter")?;
    let (keyword, rest) = (
        parameter.getattr("KEYWORD_ONLY")?,
        parameter.getattr("VAR_KEYWORD")?,
    );
    let types = PyDict::new(py);
    let mut all = Vec::new();
    let own = inspect.call_method1("signature", (class,))?;
    for one in own
        .getattr("parameters")?
        .call_method0("values")?
        .try_iter()?
    {
        let one = one?;
        let is_gravity = one.getattr("name")?.eq("gravity")?;
        if one.getattr("kind")?.ne(&rest)? {
            all.push(one);
        }
        if is_gravity {
            for (name, default, python) in options {
                let default = [("default", default)].into_py_dict(py)?;
                all.push(parameter.call((name, &keyword), Some(&default))?);
                types.set_item(name, python)?;
            }
        }
    }
    class.setattr("__signature__", inspect.call_method1("Signature", (all,))?)?;
    Ok(types)
}

/// Puts the options into the signatures of the classes that take them, and tells the writer of the
/// stub their types by class, and the words of other arguments.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let steps = described_steps(py)?;
    let options = PyDict::new(py);
    for (class, own) in [
        (py.get_type::<Simulation>(), &steps),
        (py.get_type::<BallSimulation>(), &steps),
        (py.get_type::<TwoWheelRoverSimulation>(), &steps),
        (py.get_type::<MirroredRoverSimulation>(), &steps),
        (
            py.get_type::<DiskSimulation>(),
            &bed_options::described::<2>(py)?,
        ),
        (
            py.get_type::<GrainSimulation>(),
            &bed_options::described::<3>(py)?,
        ),
    ] {
        options.set_item(class.name()?, sign(&class, own)?)?;
    }
    module.setattr("_options", options)?;
    let words = PyDict::new(py);
    words.set_item("_Accuracy", literal(&PRESETS))?;
    words.set_item("_ContactRule", literal(&RULES))?;
    words.set_item("_Method", literal(&METHODS))?;
    module.setattr("_types", words)
}
