//! A wheel as sand meets it: its place on a body, and its geometry.

use crate::multibody::Wheel;
use crate::sand::SandWheel;

/// A wheel on a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedWheel {
    /// Body that it is fixed to.
    pub body: usize,
    /// Centre and unit axle in the body's frame.
    pub centre: [f64; 3],
    pub axle: [f64; 3],
    /// Geometry of the wheel in sand.
    pub shape: SandWheel,
}

impl PlacedWheel {
    /// Place and geometry of a model's wheel.
    pub(crate) fn of(wheel: &Wheel) -> Self {
        Self {
            body: wheel.body,
            centre: wheel.centre.into(),
            axle: wheel.axle.into(),
            shape: SandWheel {
                radius: wheel.radius,
                width: wheel.width,
                rounding: wheel.rounding,
                grouser_height: wheel.grouser_height,
                grousers: wheel.grousers,
            },
        }
    }
}
