//! Names of materials, and laws by their pairs.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rover_core::law::materials::{MaterialPair, Materials, is_name};

use crate::arguments::{Given, number, refused, text};
use crate::errors::{Kind, Result, Value};

const WHAT: &str = "a mapping of pairs of names to (friction, restitution), or a list of \
                    (name, name, friction, restitution)";

/// The laws of pairs: a mapping `{(a, b): (friction, restitution)}`, or rows `(a, b, friction,
/// restitution)`.
pub fn parse(given: &Bound<'_, PyAny>) -> Result<Materials> {
    let wrong = || refused(given, Kind::Option, "materials", WHAT);
    let mut pairs = Vec::new();
    if let Ok(mapping) = given.cast::<PyDict>() {
        for (names, law) in mapping.iter() {
            let ([first, second], law) = (items(&names), items(&law));
            let [mu, e] = law;
            pairs.push(pair(first, second, mu, e).ok_or_else(wrong)??);
        }
    } else {
        for row in given.try_iter().map_err(|_| wrong())? {
            let [first, second, mu, e] = items(&row?);
            pairs.push(pair(first, second, mu, e).ok_or_else(wrong)??);
        }
    }
    Ok(Materials::new(pairs))
}

/// The entries of a tuple or a list of this length, otherwise none.
fn items<'py, const N: usize>(given: &Bound<'py, PyAny>) -> [Option<Bound<'py, PyAny>>; N] {
    if !given.len().is_ok_and(|n| n == N) {
        return std::array::from_fn(|_| None);
    }
    let listed = given.extract::<Vec<Bound<'py, PyAny>>>();
    let mut listed = listed.unwrap_or_default().into_iter();
    std::array::from_fn(|_| listed.next())
}

/// One law; `None` if a part of it is missing.
fn pair(
    first: Option<Bound<'_, PyAny>>,
    second: Option<Bound<'_, PyAny>>,
    mu: Option<Bound<'_, PyAny>>,
    e: Option<Bound<'_, PyAny>>,
) -> Option<Result<MaterialPair>> {
    let (first, second, mu, e) = (first?, second?, mu?, e?);
    let name = |given| text(given, Kind::Option, "materials");
    let of = |given| number(given, Kind::Option, "materials");
    let read = || {
        Ok(MaterialPair {
            materials: [name(&first)?, name(&second)?],
            friction_coefficient: of(&mu)?,
            restitution: of(&e)?,
        })
    };
    Some(read())
}

/// The laws as rows that [`parse`] reads, and that every text format can hold.
pub fn rows<'py>(py: Python<'py>, materials: &Materials) -> Result<Bound<'py, PyList>> {
    let row = |pair: &MaterialPair| {
        let [first, second] = &pair.materials;
        (
            first.clone(),
            second.clone(),
            pair.friction_coefficient,
            pair.restitution,
        )
    };
    Ok(PyList::new(py, materials.pairs().iter().map(row))?)
}

/// Name of a terrain's material, or nothing where none was given.
pub fn name(given: Given<'_>) -> Result<Option<String>> {
    let Some(given) = given.some() else {
        return Ok(None);
    };
    let name = text(&given, Kind::Terrain, "material")?;
    if is_name(&name) {
        return Ok(Some(name));
    }
    Err(Kind::Terrain.error(
        "material",
        format!("material: a name has 1 to 100 characters, is {name:?}"),
        Value::Text(name),
    ))
}
