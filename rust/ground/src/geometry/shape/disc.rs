//! Disc of zero width: a wheel.

use nalgebra::Vector3;

use super::SupportMap;

/// A wheel in space: centre, unit axle and in-plane unit spoke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// m.
    pub centre: Vector3<f64>,
    /// Unit.
    pub axle: Vector3<f64>,
    /// Unit, in the disc's plane.
    pub spoke: Vector3<f64>,
    /// m.
    pub radius: f64,
}

/// Length below which a difference does not define a direction.
const NO_DIRECTION: f64 = 1e-12;

impl SupportMap for Disc {
    /// A point of the rim; the centre for a direction along the axle, where all rim points are
    /// equally far.
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let project = |x: Vector3<f64>| x - self.axle * self.axle.dot(&x);
        // Projected twice: near the axle direction the first projection is dominated by rounding.
        let in_plane = project(project(*direction));
        let length = in_plane.norm();
        if length > NO_DIRECTION * direction.norm() {
            self.centre + in_plane * (self.radius / length)
        } else {
            self.centre
        }
    }

    fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    fn bound(&self) -> f64 {
        self.radius
    }
}
