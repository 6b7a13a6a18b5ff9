//! Ball of ground.

use nalgebra::Vector3;

/// The ball `|x − a| ≤ r` of ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// a, world, m.
    pub centre: Vector3<f64>,
    /// r, m.
    pub radius: f64,
}

impl Sphere {
    /// Signed distance of a point (m), positive outside.
    #[inline]
    #[must_use]
    pub fn distance(&self, x: &Vector3<f64>) -> f64 {
        (x - self.centre).norm() - self.radius
    }
}
