//! Machines that the tests share.

use rover_core::multibody::{Model, ModelDescription};

/// One free solid with a mass (kg) and further fields of its description.
pub fn described(mass: f64, rest: &str) -> ModelDescription {
    let text = format!("name = 'machine'\n[[solids]]\nname = 'body'\nmass = {mass}\n{rest}\n");
    ModelDescription::from_toml(&text).unwrap()
}

/// The same, checked and built.
pub fn body(mass: f64, rest: &str) -> Model {
    Model::from_description(described(mass, rest)).unwrap()
}
