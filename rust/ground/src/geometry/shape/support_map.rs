//! The support map of a convex body.

use nalgebra::Vector3;

/// A convex body, represented by its support map.
pub trait SupportMap {
    /// The point furthest along `direction`, which need not be a unit vector.
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64>;

    /// A point inside the body, m.
    fn centre(&self) -> Vector3<f64>;

    /// Radius of a bounding ball about the centre, m.
    fn bound(&self) -> f64;
}
