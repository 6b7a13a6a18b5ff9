//! Width and rounding of a description.

use rover_core::multibody::{Model, ModelDescription};

use super::wheel_scenes::wide_rover;

#[test]
fn a_wide_wheel_is_written_and_read_and_tells_models_apart() {
    let wide = wide_rover(0.2, 0.05);
    let text = wide.description().to_toml().unwrap();
    let again = Model::from_description(ModelDescription::from_toml(&text).unwrap()).unwrap();
    assert_eq!(wide.fingerprint(), again.fingerprint());
    assert_ne!(wide.fingerprint(), Model::rover().fingerprint());
    let smaller = wide.with_contact_radius(0.2).unwrap();
    assert!((smaller.wheels()[0].width - 0.2).abs() < 1e-15);
}
