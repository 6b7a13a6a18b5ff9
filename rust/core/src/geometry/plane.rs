//! Half-space `n · x + d ≥ 0` of free room above a plane.

use nalgebra::{Unit, Vector3};

use super::error::TerrainError;
use super::terrain::{Primitive, Terrain};

/// Plane `n · x + d = 0`, `|n| = 1`, n pointing from the ground to the free side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    normal: Unit<Vector3<f64>>,
    offset: f64,
}

impl Plane {
    /// From a normal of any length; `offset` belongs to the normalised one (m).
    ///
    /// # Errors
    /// `NotFinite`, `NoDirection`.
    pub fn new(normal: [f64; 3], offset: f64) -> Result<Self, TerrainError> {
        for value in normal {
            if !value.is_finite() {
                return Err(TerrainError::NotFinite {
                    field: "normal",
                    value,
                });
            }
        }
        if !offset.is_finite() {
            return Err(TerrainError::NotFinite {
                field: "offset",
                value: offset,
            });
        }
        let direction = Unit::try_new(Vector3::from(normal), 1e-9);
        direction
            .map(|normal| Self { normal, offset })
            .ok_or(TerrainError::NoDirection { value: normal })
    }

    /// Flat ground at height 0.
    #[must_use]
    pub fn ground() -> Self {
        Self {
            normal: Vector3::y_axis(),
            offset: 0.0,
        }
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// `d`, m.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Signed distance of a point (m), positive on the free side.
    #[inline]
    #[must_use]
    pub fn distance(&self, x: &Vector3<f64>) -> f64 {
        self.normal.dot(x) + self.offset
    }
}

impl Terrain for Plane {
    #[inline]
    fn visit_near(
        &self,
        _centre: &Vector3<f64>,
        _reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        visit(0, &Primitive::Plane(*self));
    }

    #[inline]
    fn can_be_passed(&self) -> bool {
        false
    }

    #[inline]
    fn primitive(&self, _id: u32) -> Primitive {
        Primitive::Plane(*self)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let n = &self.normal;
        (n.y.abs() > 1e-12).then(|| -(n.x * x + n.z * z + self.offset) / n.y)
    }

    fn ground(&self) -> Option<&Plane> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalises_and_measures() {
        let plane = Plane::new([0.0, 2.0, 0.0], -0.5).unwrap();
        assert!((plane.distance(&Vector3::new(3.0, 2.0, 1.0)) - 1.5).abs() < 1e-15);
        assert_eq!(
            Plane::new([0.0; 3], 0.0),
            Err(TerrainError::NoDirection { value: [0.0; 3] })
        );
        assert_eq!(
            Plane::new([0.0, 1.0, 0.0], f64::NAN).unwrap_err().field(),
            "offset"
        );
        assert_eq!(
            Plane::new([0.0, f64::INFINITY, 0.0], 0.0)
                .unwrap_err()
                .field(),
            "normal"
        );
    }
}
