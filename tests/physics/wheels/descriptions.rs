//! Width and rounding of a description.

use rover_core::lanes::machine::Machine;
use rover_core::multibody::{Model, ModelDescription};

use super::wheel_scenes::wide_rover;

#[test]
fn width_and_rounding_are_checked_by_name() {
    for (width, rounding, field, message) in [
        (
            -0.1,
            0.0,
            "wheels[2].width",
            "must not be negative, is -0.1",
        ),
        (f64::NAN, 0.0, "wheels[2].width", "must be finite, is NaN"),
        (1e-9, 0.0, "wheels[2].width", "from 1e-6 to 1e6 m"),
        (0.1, -0.01, "wheels[2].rounding", "must not be negative"),
        (
            0.1,
            0.06,
            "wheels[2].rounding",
            "at most half the wheel's width, is 0.06",
        ),
        (
            0.0,
            0.01,
            "wheels[2].rounding",
            "at most half the wheel's width",
        ),
        (0.1, f64::NAN, "wheels[2].rounding", "must be finite"),
        (
            3.0,
            1.0,
            "wheels[2].rounding",
            "smaller than the wheel's radius",
        ),
    ] {
        let mut description = ModelDescription::rover();
        let wheel = &mut description.wheels[2];
        (wheel.width, wheel.rounding) = (Some(width), Some(rounding));
        let error = Model::from_description(description).unwrap_err();
        assert_eq!(error.field(), field, "{error}");
        assert!(error.to_string().contains(message), "{error}");
    }
}

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

#[test]
fn wheels_of_any_width_have_a_fast_step() {
    for (width, rounding) in [(0.0, 0.0), (0.2, 0.05), (0.15, 0.075)] {
        assert!(Machine::of(&wide_rover(width, rounding)).is_ok());
    }
}
