//! Ground below a plane; the half-space `n · x + d ≥ 0` above it is free.

use nalgebra::{Unit, Vector3};

use super::error::TerrainError;
use super::limits::MAX_SIZE;
use friction_contact::scalar::elementary::sin_cos;

/// Largest deviation of the squared length of a normalised vector from 1: three roundings of its
/// entries, and those of the square.
const UNIT: f64 = 8.0 * f64::EPSILON;

/// Plane `n · x + d = 0`, `|n| = 1`, n pointing from the ground to the free side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    normal: Unit<Vector3<f64>>,
    offset: f64,
}

impl Plane {
    /// From a normal of any length; `offset` belongs to the normalised one (m). A
    /// normal whose length is 1 up to rounding is taken as it is, so that a
    /// plane's own normal makes the same plane again, to the bit.
    ///
    /// # Errors
    /// `NotFinite`; `NoDirection` for a normal shorter than 1e-9;
    /// `OutOfRange` for an offset beyond [`MAX_SIZE`].
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
        if offset.abs() > MAX_SIZE {
            return Err(TerrainError::OutOfRange {
                field: "offset",
                range: "at most 1e6 m either way",
                value: offset,
            });
        }
        let given = Vector3::from(normal);
        // A vector whose squared length overflows is first scaled to about 1.
        let largest = given.amax();
        let scaled = if largest > 1e100 {
            given / largest
        } else {
            given
        };
        let normal = if (scaled.norm_squared() - 1.0).abs() <= UNIT {
            Unit::new_unchecked(scaled)
        } else {
            Unit::try_new(scaled, 1e-9).ok_or(TerrainError::NoDirection { value: normal })?
        };
        Ok(Self { normal, offset })
    }

    /// The plane through the origin that rises by `slope` in the direction `uphill` (about +y from
    /// +x), both rad.
    ///
    /// # Errors
    /// `NotFinite` for an angle that is not finite.
    pub fn tilted(slope: f64, uphill: f64) -> Result<Self, TerrainError> {
        let (across, up) = sin_cos(slope);
        let (sine, cosine) = sin_cos(uphill);
        Self::new([-across * cosine, up, across * sine], 0.0)
    }

    /// Through a point (world, m) with a unit normal.
    #[inline]
    #[must_use]
    pub fn through(x: &Vector3<f64>, normal: Vector3<f64>) -> Self {
        let offset = -normal.dot(x);
        Self {
            normal: Unit::new_unchecked(normal),
            offset,
        }
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
