//! A contact of the soil and its name.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::integrator::UnilateralContact;

/// From here on a second body is a wall.
pub(crate) const WALL: u32 = 1 << 31;
/// From here on a second body is the ground.
pub(crate) const GROUND: u32 = (1 << 31) | (1 << 30);

/// Names a contact by its two bodies: disks 0 to n − 1, then the machine's wheels; then walls, then points of the ground.
///
/// Among two disks the smaller number comes first, a wheel before a disk. Contacts are listed in this order, so a step finds
/// the impulse of the step before by bisection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SoilKey {
    /// The first body.
    pub a: u32,
    /// The second body.
    pub b: u32,
}

/// A contact of the soil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoilContact {
    /// Its name from step to step.
    pub key: SoilKey,
    /// Unit normal, from the second body into the first.
    pub n: Vector2<f64>,
    /// Point on the first body's rim, world, m.
    pub point: Vector2<f64>,
    /// Predicted at the end of the step without contact, m.
    pub gap: f64,
    /// At the start of the step, m.
    pub gap_start: f64,
}

impl SoilContact {
    /// Tangent n × e_z.
    #[must_use]
    pub fn t(&self) -> Vector2<f64> {
        Vector2::new(self.n.y, -self.n.x)
    }

    /// Whether the second body is a disk.
    #[must_use]
    pub fn is_with_disk(&self) -> bool {
        self.key.b < WALL
    }
}

impl UnilateralContact for SoilContact {
    type Key = SoilKey;

    fn key(&self) -> SoilKey {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}
