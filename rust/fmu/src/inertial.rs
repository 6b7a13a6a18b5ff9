//! An ideal inertial unit at the trunk's origin, in the trunk's frame.
//!
//! Where the velocity may jump it has no acceleration at an instant: the unit tells means over an
//! interval.

use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

/// Motion of the trunk at the begin of an interval.
pub struct TrunkMotion {
    velocity: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
}

impl TrunkMotion {
    /// At this moment.
    pub fn of(rover: &RoverSimulation) -> Self {
        Self {
            velocity: Vector3::from_column_slice(&rover.v()[..3]),
            attitude: rover.q().attitude,
        }
    }

    /// Mean specific force, m/s², and mean angular velocity, rad/s, from then until now.
    pub fn readings(&self, rover: &RoverSimulation, gravity: [f64; 3], interval: f64) -> [f64; 6] {
        let now = Self::of(rover);
        let turn = (self.attitude.inverse() * now.attitude).scaled_axis();
        let halfway = self.attitude * UnitQuaternion::from_scaled_axis(0.5 * turn);
        let acceleration = (now.velocity - self.velocity) / interval - Vector3::from(gravity);
        joined(halfway.inverse() * acceleration, turn / interval)
    }
}

/// Specific force, m/s², and angular velocity, rad/s, of a unit that does not accelerate: the
/// readings before the first interval.
pub fn unaccelerated(rover: &RoverSimulation, gravity: [f64; 3]) -> [f64; 6] {
    let into = rover.q().attitude.inverse();
    let angular_velocity = Vector3::from_column_slice(&rover.v()[3..6]);
    joined(into * -Vector3::from(gravity), into * angular_velocity)
}

fn joined(force: Vector3<f64>, angular_velocity: Vector3<f64>) -> [f64; 6] {
    let ([a, b, c], [d, e, f]) = (force.into(), angular_velocity.into());
    [a, b, c, d, e, f]
}
