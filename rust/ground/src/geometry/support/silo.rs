//! A silo: balls inside an upright cylinder, perhaps on a floor with a round hole.

use nalgebra::Vector3;

use super::{Facing, Support};
use crate::spatial::space::length;
use friction_contact::quantity::{Demand, LENGTHS, PLACES, QuantityError, finite, within};

/// A flat floor of no thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// m.
    pub height: f64,
    /// Radius of the hole in its middle, m; 0 for none.
    pub hole: f64,
}

/// An upright tube, open above. With a floor it ends there, and what falls through the hole is
/// free; without one it has no end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silo {
    axis: [f64; 2],
    radius: f64,
    floor: Option<Floor>,
}

impl Silo {
    /// Around the upright axis at (x, z) (m).
    ///
    /// # Errors
    /// A number that is not finite or out of its range, a hole as wide as the tube.
    pub fn new(axis: [f64; 2], radius: f64, floor: Option<Floor>) -> Result<Self, QuantityError> {
        for (k, value) in axis.iter().enumerate() {
            within(|| format!("axis[{k}]"), *value, PLACES)?;
        }
        within(|| "radius".to_owned(), radius, LENGTHS)?;
        if let Some(floor) = &floor {
            within(|| "floor".to_owned(), floor.height, PLACES)?;
            let value = finite("hole", floor.hole)?;
            if !(0.0..radius).contains(&value) {
                let range = Demand::Within("from 0 to less than the radius of the tube");
                return Err(QuantityError::new("hole", range, value));
            }
        }
        Ok(Self {
            axis,
            radius,
            floor,
        })
    }

    /// (x, z), m.
    #[must_use]
    pub fn axis(&self) -> [f64; 2] {
        self.axis
    }

    /// m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Floor of the silo, if there is one.
    #[must_use]
    pub fn floor(&self) -> Option<Floor> {
        self.floor
    }
}

/// What of a floor faces a place at the height `y` over it, `away` from the axis in the direction
/// `outward`: the floor itself from either side, or the rim of its hole.
fn of_floor(floor: &Floor, y: f64, away: f64, outward: &Vector3<f64>) -> (Vector3<f64>, f64) {
    if away >= floor.hole {
        let n = if y >= 0.0 {
            Vector3::y()
        } else {
            -Vector3::y()
        };
        return (n, y.abs());
    }
    let from_rim = outward * (away - floor.hole) + Vector3::y() * y;
    let distance = length(from_rim.as_slice());
    (from_rim / distance, distance)
}

impl Support<3> for Silo {
    fn facing(&self, centre: &Vector3<f64>, reach: f64, out: &mut Vec<Facing<3>>) {
        let from = [centre.x - self.axis[0], centre.z - self.axis[1]];
        let away = length(&from);
        let outward = if away > 0.0 {
            Vector3::new(from[0] / away, 0.0, from[1] / away)
        } else {
            Vector3::x()
        };
        let over = self.floor.map_or(0.0, |floor| centre.y - floor.height);
        let tube = (over >= 0.0).then_some((-outward, self.radius - away));
        let is_within = away <= self.radius + reach;
        let floor = self.floor.filter(|_| is_within);
        let floor = floor.map(|floor| of_floor(&floor, over, away, &outward));
        for (n, distance) in [tube, floor].into_iter().flatten() {
            if distance <= reach {
                out.push(Facing {
                    foot: centre - n * distance,
                    n,
                    distance,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facing(silo: &Silo, centre: [f64; 3], reach: f64) -> Vec<Facing<3>> {
        let mut out = Vec::new();
        silo.facing(&centre.into(), reach, &mut out);
        out
    }

    fn with_hole() -> Silo {
        let floor = Floor {
            height: 1.0,
            hole: 0.2,
        };
        Silo::new([3.0, 4.0], 0.5, Some(floor)).expect("a silo")
    }

    #[test]
    fn tube_floor_and_rim_face_a_ball() {
        let silo = with_hole();
        let found = facing(&silo, [3.0, 1.05, 4.45], 0.1);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].n + Vector3::z()).norm() < 1e-12);
        assert!((found[0].distance - 0.05).abs() < 1e-12);
        assert!((found[1].n - Vector3::y()).norm() < 1e-12);
        assert!((found[1].distance - 0.05).abs() < 1e-12);
        let found = facing(&silo, [3.16, 1.03, 4.0], 0.1);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].foot - Vector3::new(3.2, 1.0, 4.0)).norm() < 1e-12);
        assert!((found[0].distance - 0.05).abs() < 1e-12, "0.04 and 0.03");
    }

    #[test]
    fn nothing_holds_a_ball_over_the_hole_or_below_it() {
        let silo = with_hole();
        assert!(facing(&silo, [3.0, 1.0, 4.0], 0.1).is_empty());
        assert!(facing(&silo, [3.0, 0.5, 4.48], 0.1).is_empty(), "no tube");
        let below = facing(&silo, [3.3, 0.97, 4.0], 0.1);
        assert!((below[0].n + Vector3::y()).norm() < 1e-12, "from below");
    }

    #[test]
    fn the_hole_is_narrower_than_the_tube() {
        let floor = Floor {
            height: 0.0,
            hole: 0.6,
        };
        let refused = Silo::new([0.0; 2], 0.5, Some(floor)).expect_err("too wide");
        assert_eq!(refused.field(), "hole");
    }
}
