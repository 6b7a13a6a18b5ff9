//! Test rig: one wheel on a carriage, with prescribed rates of travel and rotation, free to sink.
//!
//! Coordinates (x, y, –, θ_w, –): travel of the carriage, height of the wheel, its angle. Mass and
//! inertia of travel and angle are so large that no soil changes their rates in double precision.
//! The slip `1 − ẋ/(r |θ̇_w|)` is thus prescribed, and the drawbar pull, the horizontal force of
//! the soil on the wheel, is the result.

use nalgebra::Vector2;

use super::error::PlanarError;
use super::tree::{DiscWheel, PlanarBody, PlanarTree, fingerprint};
use crate::quantity::{LENGTHS, MASSES, within};

/// A wheel of the test rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelRig {
    mass: f64,
    radius: f64,
}

/// Multiple of the wheel's mass that keeps a rate constant.
const HEAVY: f64 = 1e12;

impl WheelRig {
    /// `mass` (kg) that the soil carries, `radius` in m.
    ///
    /// # Errors
    /// A number that is not finite and positive.
    pub fn new(mass: f64, radius: f64) -> Result<Self, PlanarError> {
        Ok(Self {
            mass: within(|| "mass".to_owned(), mass, MASSES)?,
            radius: within(|| "radius".to_owned(), radius, LENGTHS)?,
        })
    }
}

impl From<WheelRig> for PlanarTree {
    fn from(rig: WheelRig) -> Self {
        let WheelRig { mass, radius } = rig;
        let heavy = HEAVY * mass;
        let turning = heavy * radius * radius;
        let part = |mass: f64| PlanarBody::centred(Vector2::zeros(), mass, 0.0);
        Self::new(
            vec![part(mass), part(0.0), part(0.0)],
            vec![DiscWheel::driven(1, radius)],
            fingerprint("rig", [mass, radius]),
        )
        .held_by(vec![heavy, 0.0, turning, turning, turning])
    }
}
