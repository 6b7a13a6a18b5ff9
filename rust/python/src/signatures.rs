//! Signatures of the classes that take the options of a step, and types for the writer of the stub.

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

use crate::accuracy::PRESETS;
use crate::options::{GRAIN_STABILISATIONS, METHODS, described, literal};
use crate::planar::RULES;
use crate::planar_machines::{BallSimulation, MirroredRoverSimulation, TwoWheelRoverSimulation};
use crate::simulation::Simulation;

/// Puts the options into the signatures of the classes that take them, and tells the writer of the
/// stub their types and the words of other arguments.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let types = PyDict::new(py);
    let inspect = py.import("inspect")?;
    let parameter = inspect.getattr("Parameter")?;
    let (keyword, rest) = (
        parameter.getattr("KEYWORD_ONLY")?,
        parameter.getattr("VAR_KEYWORD")?,
    );
    let mut options = Vec::new();
    for (name, default, python) in described(py)? {
        let default = [("default", default)].into_py_dict(py)?;
        options.push(parameter.call((name, &keyword), Some(&default))?);
        types.set_item(name, python)?;
    }
    for class in [
        py.get_type::<Simulation>(),
        py.get_type::<BallSimulation>(),
        py.get_type::<TwoWheelRoverSimulation>(),
        py.get_type::<MirroredRoverSimulation>(),
    ] {
        let own = inspect.call_method1("signature", (&class,))?;
        let mut all = Vec::new();
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
                all.extend_from_slice(&options);
            }
        }
        class.setattr("__signature__", inspect.call_method1("Signature", (all,))?)?;
    }
    types.set_item("_Accuracy", literal(&PRESETS))?;
    types.set_item("_ContactRule", literal(&RULES))?;
    types.set_item("_GrainStabilisation", literal(&GRAIN_STABILISATIONS))?;
    types.set_item("_Method", literal(&METHODS))?;
    module.setattr("_types", types)
}
