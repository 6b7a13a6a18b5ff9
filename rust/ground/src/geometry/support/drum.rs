//! A rotating drum: balls inside a cylinder whose axis lies along z.

use nalgebra::Vector3;

use super::{Facing, Support};
use crate::spatial::space::length;
use friction_contact::quantity::{LENGTHS, PLACES, QuantityError, finite, within};

/// A barrel along z that turns about its axis between two ends at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drum {
    centre: Vector3<f64>,
    radius: f64,
    half: f64,
    rate: f64,
}

impl Drum {
    /// Around `centre` (m), of this radius and length (m), turning about +z at `rate` (rad/s).
    ///
    /// # Errors
    /// A number that is not finite, a radius or length that is not positive or out of its range.
    pub fn new(
        centre: Vector3<f64>,
        radius: f64,
        length: f64,
        rate: f64,
    ) -> Result<Self, QuantityError> {
        for (k, value) in centre.iter().enumerate() {
            within(|| format!("centre[{k}]"), *value, PLACES)?;
        }
        within(|| "radius".to_owned(), radius, LENGTHS)?;
        within(|| "length".to_owned(), length, LENGTHS)?;
        Ok(Self {
            centre,
            radius,
            half: 0.5 * length,
            rate: finite("rate", rate)?,
        })
    }

    /// m.
    #[must_use]
    pub fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    /// m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// m.
    #[must_use]
    pub fn length(&self) -> f64 {
        2.0 * self.half
    }

    /// About +z, rad/s.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.rate
    }
}

impl Support<3> for Drum {
    fn facing(&self, centre: &Vector3<f64>, reach: f64, out: &mut Vec<Facing<3>>) {
        let from = centre - self.centre;
        let away = length(&[from.x, from.y]);
        let outward = if away > 0.0 {
            Vector3::new(from.x / away, from.y / away, 0.0)
        } else {
            -Vector3::y()
        };
        for (n, distance) in [
            (-outward, self.radius - away),
            (Vector3::z(), self.half + from.z),
            (-Vector3::z(), self.half - from.z),
        ] {
            if distance <= reach {
                out.push(Facing {
                    foot: centre - n * distance,
                    n,
                    distance,
                });
            }
        }
    }

    fn velocity(&self, at: &Facing<3>) -> Vector3<f64> {
        if at.n.z != 0.0 {
            return Vector3::zeros();
        }
        let from = at.foot - self.centre;
        Vector3::new(-from.y, from.x, 0.0) * self.rate
    }

    fn spin(&self, at: &Facing<3>) -> [f64; 3] {
        let rate = if at.n.z == 0.0 { self.rate } else { 0.0 };
        [0.0, 0.0, rate]
    }

    fn fastest(&self) -> f64 {
        self.rate.abs() * self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barrel_and_end_carry_a_ball_in_the_corner_and_the_barrel_turns() {
        let drum = Drum::new(Vector3::new(1.0, 2.0, 3.0), 0.5, 0.4, 3.0).expect("a drum");
        let mut out = Vec::new();
        let centre = Vector3::new(1.3, 1.6, 3.15);
        drum.facing(&centre, 0.1, &mut out);
        assert_eq!(out.len(), 2, "{out:?}");
        let (barrel, end) = (&out[0], &out[1]);
        assert!(barrel.distance.abs() < 1e-12, "0.3 and 0.4 make 0.5");
        assert!((barrel.n - Vector3::new(-0.6, 0.8, 0.0)).norm() < 1e-12);
        let expected = Vector3::new(1.2, 0.9, 0.0);
        assert!((drum.velocity(barrel) - expected).norm() < 1e-12);
        assert!((end.distance - 0.05).abs() < 1e-12 && end.n == -Vector3::z());
        assert!(drum.velocity(end).norm() < 1e-12, "ends are at rest");
        assert!((drum.fastest() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_ball_outside_is_deep_in_the_barrel() {
        let drum = Drum::new(Vector3::zeros(), 0.5, 0.4, 0.0).expect("a drum");
        let mut out = Vec::new();
        drum.facing(&Vector3::new(0.0, 0.9, 0.0), 0.1, &mut out);
        assert!((out[0].distance + 0.4).abs() < 1e-12 && out[0].n == -Vector3::y());
    }
}
