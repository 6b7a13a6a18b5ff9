//! Closed loops of a model, as Python sees them.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::contact::loops;
use rover_core::multibody::{Configuration, Model, coordinates};

use crate::arrays::{Array, fresh};
use crate::errors::Result;

/// A dictionary for each loop of a model.
pub fn list<'py>(py: Python<'py>, model: &Model) -> Result<Vec<Bound<'py, PyDict>>> {
    let redundant = loops::redundant_rows(model, &Configuration::zero(model));
    let described = model.description().loops.iter();
    let rows = model.loops().iter().zip(redundant);
    let entry = |(closure, (made, redundant)): (_, _)| {
        let closure: &rover_core::multibody::LoopDescription = closure;
        let made: &rover_core::multibody::Loop = made;
        let entry = PyDict::new(py);
        entry.set_item("name", &closure.name)?;
        entry.set_item("kind", closure.kind.name())?;
        entry.set_item("solid", &closure.solid)?;
        entry.set_item("other", &closure.other)?;
        entry.set_item("rows", made.n_rows())?;
        let redundant: usize = redundant;
        entry.set_item("redundant", redundant)?;
        Ok(entry)
    };
    described.zip(rows).map(entry).collect()
}

/// The nearest coordinates (nv) that close all loops, and the velocity (nv) without what opens
/// them.
pub fn closed(model: &Model, q: &[f64], v: &mut [f64]) -> Result<(Array, Array)> {
    let configuration = coordinates::from_public(model, q)?;
    let closed = loops::closed(model, &configuration, v)?;
    Ok((coordinates::to_public(model, &closed).into(), fresh(v)))
}

/// Force and moment of each loop on its first end, (3,) N, and (3,) N m or one number of a joint.
pub fn forces<'py>(py: Python<'py>, model: &Model, forces: &[f64]) -> Result<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    let mut first = 0;
    for closure in model.loops() {
        let end = first + closure.n_rows();
        found.set_item(&closure.name, fresh(&forces[first..end]))?;
        first = end;
    }
    Ok(found)
}
