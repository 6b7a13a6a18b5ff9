//! The models that come with the simulator, by name.

use super::ModelDescription;
use crate::multibody::error::{ModelError, ModelFault};

/// Names and files, the built-in rover first.
const GALLERY: [(&str, &str); 5] = [
    ("rover", include_str!("../../../models/rover.toml")),
    (
        "mars-rover",
        include_str!("../../../models/mars-rover.toml"),
    ),
    (
        "open-rover",
        include_str!("../../../models/open-rover.toml"),
    ),
    (
        "skid-steered",
        include_str!("../../../models/skid-steered.toml"),
    ),
    (
        "four-steered",
        include_str!("../../../models/four-steered.toml"),
    ),
];

impl ModelDescription {
    /// Names of the models of the gallery; the first is the built-in rover.
    #[must_use]
    pub fn names() -> [&'static str; GALLERY.len()] {
        GALLERY.map(|(name, _)| name)
    }

    /// The model of the gallery with this name.
    ///
    /// # Errors
    /// [`ModelFault::UnknownModel`] with the known names.
    pub fn named(name: &str) -> Result<Self, ModelError> {
        let found = GALLERY.iter().find(|(known, _)| *known == name);
        let (_, text) = found.ok_or_else(|| {
            ModelFault::UnknownModel {
                name: name.to_owned(),
                known: Self::names().join(", "),
            }
            .at("name")
        })?;
        Self::from_toml(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::Model;

    #[test]
    fn every_model_of_the_gallery_is_read_and_has_the_name_it_is_found_by() {
        for name in ModelDescription::names() {
            let description = ModelDescription::named(name).unwrap();
            assert_eq!(description.name, name);
            assert!(Model::from_description(description).is_ok(), "{name}");
        }
        let mut rigid = ModelDescription::named("rover").unwrap();
        for wheel in &mut rigid.wheels {
            wheel.forget_tread();
        }
        assert_eq!(rigid, ModelDescription::rover());
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let error = ModelDescription::named("opportunity").unwrap_err();
        assert!(error.to_string().contains("mars-rover"), "{error}");
    }
}
