//! Signatures of the classes that take options, and types for the writer of the stub.

use pyo3::PyTypeInfo;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use rover_core::integrator::StepOptions;

use crate::accuracy::PRESETS;
use crate::balls::GrainSimulation;
use crate::bed_options::BedOptions;
use crate::disks::DiskSimulation;
use crate::options::{METHODS, Options, described, literal};
use crate::planar::RULES;
use crate::planar_machines::{BallSimulation, MirroredRoverSimulation, TwoWheelRoverSimulation};
use crate::simulation::Simulation;

/// Puts options into the signature of a class, in the place of `**options`, and enters their types.
fn sign<C: PyTypeInfo, T: Options>(types: &Bound<'_, PyDict>) -> PyResult<()> {
    let py = types.py();
    let (class, own) = (py.get_type::<C>(), PyDict::new(py));
    let inspect = py.import("inspect")?;
    let parameter = inspect.getattr("Parameter")?;
    let keyword = parameter.getattr("KEYWORD_ONLY")?;
    let signature = inspect.call_method1("signature", (&class,))?;
    let parameters = signature.getattr("parameters")?.call_method0("values")?;
    let mut all: Vec<_> = parameters.try_iter()?.collect::<PyResult<_>>()?;
    all.pop();
    for (name, default, python) in described::<T>(py)? {
        let default = [("default", default)].into_py_dict(py)?;
        all.push(parameter.call((name, &keyword), Some(&default))?);
        own.set_item(name, python)?;
    }
    class.setattr("__signature__", inspect.call_method1("Signature", (all,))?)?;
    types.set_item(class.name()?, own)
}

/// Puts the options into the signatures of the classes that take them, and tells the writer of the
/// stub their types by class, and the words of other arguments.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let options = PyDict::new(module.py());
    sign::<Simulation, StepOptions>(&options)?;
    sign::<BallSimulation, StepOptions>(&options)?;
    sign::<TwoWheelRoverSimulation, StepOptions>(&options)?;
    sign::<MirroredRoverSimulation, StepOptions>(&options)?;
    sign::<DiskSimulation, BedOptions<2>>(&options)?;
    sign::<GrainSimulation, BedOptions<3>>(&options)?;
    module.setattr("_options", options)?;
    let words = PyDict::new(module.py());
    words.set_item("_Accuracy", literal(&PRESETS))?;
    words.set_item("_ContactRule", literal(&RULES))?;
    words.set_item("_Method", literal(&METHODS))?;
    module.setattr("_types", words)
}
