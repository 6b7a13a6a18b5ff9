//! A straight wall: grains stay on one side of it.

use nalgebra::SVector;

use crate::quantity::{PLACES, QuantityError, within};
use crate::spatial::space::axis;

/// The half-plane or half-space `n · x ≥ offset` is free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall<const D: usize> {
    n: SVector<f64, D>,
    offset: f64,
}

impl<const D: usize> Wall<D> {
    /// Through `point` (m), with `normal` (any length) pointing to the free side.
    ///
    /// # Errors
    /// An entry that is not finite, a normal of no length.
    pub fn new(point: SVector<f64, D>, normal: SVector<f64, D>) -> Result<Self, QuantityError> {
        for (name, vector) in [("point", &point), ("normal", &normal)] {
            for (k, value) in vector.iter().enumerate() {
                within(|| format!("{name}[{k}]"), *value, PLACES)?;
            }
        }
        let length = normal.norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(QuantityError::NotPositive {
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
            n: axis(1),
            offset: y,
        }
    }

    /// Wall on the left of what it holds, at x, m.
    #[must_use]
    pub fn left(x: f64) -> Self {
        Self {
            n: axis(0),
            offset: x,
        }
    }

    /// Wall on the right of what it holds, at x, m.
    #[must_use]
    pub fn right(x: f64) -> Self {
        Self {
            n: -axis(0),
            offset: -x,
        }
    }

    /// Unit normal, to the free side.
    #[must_use]
    pub fn n(&self) -> SVector<f64, D> {
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
    pub fn distance(&self, point: &SVector<f64, D>) -> f64 {
        self.n.dot(point) - self.offset
    }
}
