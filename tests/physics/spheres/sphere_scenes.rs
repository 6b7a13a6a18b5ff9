//! Wheels and fields that the tests share.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::geometry::{Rocks, SphereField, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::simulation::RoverSimulation;

use crate::shared::{model, resting};

/// Mass of the lone wheel, kg.
pub const WHEEL_MASS: f64 = 30.0;

/// Radius of the lone wheel, m.
pub const WHEEL_RADIUS: f64 = 0.1;

/// A wheel that is its own base: axle along z, nothing else.
pub fn lone_wheel() -> Model {
    let text = format!(
        r#"
name = "lone wheel"
[[solids]]
name = "wheel"
mass = {WHEEL_MASS}
shape = {{ kind = "disc", radius = {WHEEL_RADIUS} }}
[[wheels]]
name = "W"
solid = "wheel"
axle = [0.0, 0.0, 1.0]
radius = {WHEEL_RADIUS}
torque_limit = 100.0
drive_sign = -1.0
"#
    );
    model(&text)
}

/// A field from (x, y, z, radius).
pub fn field(spheres: &[[f64; 4]]) -> SphereField {
    let centres: Vec<[f64; 3]> = spheres.iter().map(|s| [s[0], s[1], s[2]]).collect();
    let radii: Vec<f64> = spheres.iter().map(|s| s[3]).collect();
    SphereField::new(&centres, &radii, None).unwrap()
}

/// A model with its base at a place, upright, at rest.
pub fn placed(
    model: Model,
    terrain: impl Terrain + 'static,
    options: StepOptions,
    position: Vector3<f64>,
) -> RoverSimulation {
    resting(model, Arc::new(terrain), options, |q| {
        q.position = position;
    })
}

/// Rocks of 5 cm to 30 cm on flat ground, dense enough that a wheel always meets some.
pub fn rocks(seed: u64) -> Rocks {
    Rocks {
        abundance: 0.2,
        area: [12.0, 8.0],
        seed,
        max_diameter: 0.3,
        ..Rocks::default()
    }
}

/// Deepest gap of any wheel now, m.
pub fn deepest(simulation: &RoverSimulation) -> f64 {
    let gaps = simulation.wheel_contacts();
    gaps.iter().fold(f64::INFINITY, |m, c| m.min(c.gap))
}

/// Pseudo-random numbers in [0, 1), the same everywhere (SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }
}
