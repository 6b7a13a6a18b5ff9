//! Ball: a stone of the ground, or a part of a machine.

use nalgebra::Vector3;

use super::SupportMap;

/// The ball `|x − a| ≤ r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// a, m; in the world where the sphere belongs to the ground.
    pub centre: Vector3<f64>,
    /// r, m.
    pub radius: f64,
}

impl Sphere {
    /// About a centre, m, with a radius, m; a point if that is 0.
    #[inline]
    #[must_use]
    pub const fn new(centre: Vector3<f64>, radius: f64) -> Self {
        Self { centre, radius }
    }

    /// Signed distance of a point (m), positive outside.
    #[inline]
    #[must_use]
    pub fn distance(&self, x: &Vector3<f64>) -> f64 {
        (x - self.centre).norm() - self.radius
    }
}

impl SupportMap for Sphere {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let unit = direction.try_normalize(0.0);
        self.centre + unit.unwrap_or_else(Vector3::x) * self.radius
    }

    fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    fn bound(&self) -> f64 {
        self.radius
    }
}
