//! Convex polytope: the hull of a mesh.

use nalgebra::{Matrix3, Vector3};

use super::SupportMap;
use crate::spatial::Polytope;

/// A convex polytope in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull<'a> {
    /// Centroid, m.
    pub centre: Vector3<f64>,
    /// Rotation from the polytope's axes to the world's.
    pub R: Matrix3<f64>,
    /// Vertices, faces and edges of the hull, about its centroid.
    pub polytope: &'a Polytope,
}

impl Hull<'_> {
    /// A place in the polytope's coordinates, m.
    #[inline]
    #[must_use]
    pub fn local(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.R.tr_mul(&(x - self.centre))
    }

    /// A place of the polytope's coordinates in the world's, m.
    #[inline]
    #[must_use]
    pub fn place(&self, local: &Vector3<f64>) -> Vector3<f64> {
        self.centre + self.R * local
    }

    /// Position of a vertex, by its number.
    #[inline]
    #[must_use]
    pub fn vertex(&self, number: usize) -> Vector3<f64> {
        self.place(&self.polytope.vertices()[number])
    }

    /// The face whose plane is furthest out at a place (local, m), and the distance from it;
    /// negative inside.
    #[inline]
    #[must_use]
    pub fn outermost(&self, local: &Vector3<f64>) -> (usize, f64) {
        let mut best = (0, f64::NEG_INFINITY);
        for (k, face) in self.polytope.faces().iter().enumerate() {
            let distance = face.normal.dot(local) - face.offset;
            if distance > best.1 {
                best = (k, distance);
            }
        }
        best
    }

    /// Whether a point (m) is in it.
    #[must_use]
    pub fn holds(&self, x: &Vector3<f64>) -> bool {
        self.outermost(&self.local(x)).1 <= 0.0
    }
}

impl SupportMap for Hull<'_> {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let local = self.R.tr_mul(direction);
        self.vertex(self.polytope.furthest(&local))
    }

    fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    fn bound(&self) -> f64 {
        self.polytope.bound()
    }
}
