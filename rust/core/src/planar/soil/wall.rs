//! A straight wall: disks stay on one side of it.

use nalgebra::Vector2;

use super::super::error::{PLACES, PlanarError, within};

/// The half-plane `n · x ≥ offset` is free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    n: Vector2<f64>,
    offset: f64,
}

impl Wall {
    /// Through `point` (m), with `normal` (any length) pointing to the free side.
    ///
    /// # Errors
    /// An entry that is not finite, a normal of no length.
    pub fn new(point: Vector2<f64>, normal: Vector2<f64>) -> Result<Self, PlanarError> {
        for (name, vector) in [("point", &point), ("normal", &normal)] {
            for (k, value) in vector.iter().enumerate() {
                within(|| format!("{name}[{k}]"), *value, PLACES)?;
            }
        }
        let length = normal.norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(PlanarError::NotPositive {
                field: "normal".to_owned(),
                value: length,
            });
        }
        let n = normal / length;
        Ok(Self {
            n,
            offset: n.dot(&point),
        })
    }

    /// Floor at height y, m.
    #[must_use]
    pub fn floor(y: f64) -> Self {
        Self {
            n: Vector2::y(),
            offset: y,
        }
    }

    /// Wall on the left of what it holds, at x, m.
    #[must_use]
    pub fn left(x: f64) -> Self {
        Self {
            n: Vector2::x(),
            offset: x,
        }
    }

    /// Wall on the right of what it holds, at x, m.
    #[must_use]
    pub fn right(x: f64) -> Self {
        Self {
            n: -Vector2::x(),
            offset: -x,
        }
    }

    /// Unit normal, to the free side.
    #[must_use]
    pub fn n(&self) -> Vector2<f64> {
        self.n
    }

    /// `n · x` on the wall, m.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Signed distance of a point, m.
    #[inline]
    #[must_use]
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        self.n.x * x + self.n.y * y - self.offset
    }
}
