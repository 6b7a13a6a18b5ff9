//! Rounded cylinder: a wheel with a width.

use nalgebra::Vector3;

use super::{Disc, SupportMap};
use friction_contact::scalar::elementary::hypot;

/// A wheel with a width: two equal circles on one axle, their convex hull swept by a ball.
///
/// With radius R, width w and rounding ρ of its edges the circles have radius R − ρ and lie at
/// ±(w/2 − ρ) along the axle. A rounding of zero is a cylinder, one of w/2 a torus with its hole
/// filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roller {
    /// The disc midway between the circles, of their radius R − ρ.
    pub core: Disc,
    /// Distance of each circle from the middle, w/2 − ρ, m.
    pub half: f64,
    /// ρ, m.
    pub rounding: f64,
}

impl Roller {
    /// The wheel whose middle is `disc`, with this width (m) and rounding (m) of its edges.
    #[inline]
    #[must_use]
    pub fn new(disc: Disc, width: f64, rounding: f64) -> Self {
        Self {
            core: Disc {
                radius: disc.radius - rounding,
                ..disc
            },
            half: 0.5 * width - rounding,
            rounding,
        }
    }

    /// A disc as a wheel without width.
    #[inline]
    #[must_use]
    pub fn thin(disc: Disc) -> Self {
        Self {
            core: disc,
            half: 0.0,
            rounding: 0.0,
        }
    }

    /// R, m.
    #[inline]
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.core.radius + self.rounding
    }

    /// The disc of zero width midway along the axle, with the outer radius.
    #[inline]
    #[must_use]
    pub fn middle(&self) -> Disc {
        Disc {
            radius: self.radius(),
            ..self.core
        }
    }

    /// Number of circles: 1 for a torus.
    #[inline]
    #[must_use]
    pub fn n_circles(&self) -> usize {
        if self.half > 0.0 { 2 } else { 1 }
    }

    /// Whether a point (m) is in it.
    #[must_use]
    pub fn holds(&self, x: &Vector3<f64>) -> bool {
        let offset = x - self.core.centre;
        let along = self.core.axle.dot(&offset);
        let away = (offset - self.core.axle * along).norm();
        let beyond = [away - self.core.radius, along.abs() - self.half].map(|d| d.max(0.0));
        hypot(beyond[0], beyond[1]) <= self.rounding
    }

    /// A circle as a disc: the first lies towards the axle's head, the second towards its tail.
    #[inline]
    #[must_use]
    pub fn circle(&self, number: usize) -> Disc {
        let along = if number == 0 { self.half } else { -self.half };
        Disc {
            centre: self.core.centre + self.core.axle * along,
            ..self.core
        }
    }
}

impl SupportMap for Roller {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let along = self.half.copysign(self.core.axle.dot(direction));
        let out = direction.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        self.core.support(direction) + self.core.axle * along + out * self.rounding
    }

    fn centre(&self) -> Vector3<f64> {
        self.core.centre
    }

    fn bound(&self) -> f64 {
        hypot(self.core.radius, self.half) + self.rounding
    }
}
