//! A straight wall: grains stay on one side of it. It may move at a constant velocity.

use nalgebra::SVector;

use crate::quantity::{Demand, PLACES, QuantityError, within};
use crate::spatial::space::axis;

/// The half-plane or half-space `n · x ≥ offset` is free.
///
/// Time starts where a simulation's state is set. A wall that moves along its normal changes its
/// place with it; one that moves along itself drags what it touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall<const D: usize> {
    n: SVector<f64, D>,
    offset: f64,
    velocity: SVector<f64, D>,
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
            return Err(QuantityError::new("normal", Demand::Positive, length));
        }
        let n = normal / length;
        Ok(Self {
            n,
            offset: n.dot(&point),
            velocity: SVector::zeros(),
        })
    }

    /// Makes the wall move at `velocity` (m/s) from its place at time 0.
    ///
    /// # Errors
    /// An entry that is not finite or beyond any speed.
    pub fn moving(self, velocity: SVector<f64, D>) -> Result<Self, QuantityError> {
        for (k, value) in velocity.iter().enumerate() {
            within(|| format!("wall_velocity[{k}]"), *value, PLACES)?;
        }
        Ok(Self { velocity, ..self })
    }

    /// Floor at height y, m.
    #[must_use]
    pub fn floor(y: f64) -> Self {
        Self {
            n: axis(1),
            offset: y,
            velocity: SVector::zeros(),
        }
    }

    /// Wall on the left of what it holds, at x, m.
    #[must_use]
    pub fn left(x: f64) -> Self {
        Self {
            n: axis(0),
            offset: x,
            velocity: SVector::zeros(),
        }
    }

    /// Wall on the right of what it holds, at x, m.
    #[must_use]
    pub fn right(x: f64) -> Self {
        Self {
            n: -axis(0),
            offset: -x,
            velocity: SVector::zeros(),
        }
    }

    /// Velocity of the wall, m/s.
    #[must_use]
    pub fn velocity(&self) -> SVector<f64, D> {
        self.velocity
    }

    /// The wall at a time, s.
    #[inline]
    #[must_use]
    pub fn at(&self, time: f64) -> Self {
        Self {
            offset: self.offset + self.n.dot(&self.velocity) * time,
            ..*self
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
