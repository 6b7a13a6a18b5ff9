//! Wheels in sand as contacts: frame, force and slip.

use nalgebra::Vector3;

use super::rover::RoverSimulation;
use crate::contact::ContactFrame;
use crate::contact::part::place_wheel;
use crate::multibody::Kinematics;
use crate::scalar::elementary::hypot;

/// Speed below which, for both rim and ground, a slip ratio is meaningless, m/s.
pub const SLIP_SPEED: f64 = 0.05;

/// A wheel that is in sand.
#[derive(Clone, Copy, Debug)]
pub struct WheelContactInSand {
    /// The wheel.
    pub wheel: usize,
    /// Depth of its lowest point under the undisturbed surface, m.
    pub sinkage: f64,
    /// Normal of the surface, forward and along the axle.
    pub frame: ContactFrame,
    /// Force of the sand in the last step along the frame's n, t, b, N.
    pub force: [f64; 3],
    /// Rim slip over the faster of rim and ground: 0 for a wheel that rolls, 1 for one that spins
    /// in place or is dragged with its motor locked.
    pub slip: f64,
}

impl RoverSimulation {
    /// The wheels that are in sand; none on firm ground.
    #[must_use]
    pub fn wheels_in_sand(&self) -> Vec<WheelContactInSand> {
        let (Some(sand), Some(ground)) = (self.sand(), self.terrain().soft()) else {
            return Vec::new();
        };
        let model = self.model();
        let kinematics = Kinematics::of(model, self.q());
        let wheels = sand.wheels.iter().enumerate().zip(model.wheels());
        let wheels = wheels.filter(|((_, own), _)| own.sinkage > 0.0);
        let found = wheels.filter_map(|((i, own), wheel)| {
            let disc = place_wheel(wheel, &kinematics);
            let tangent = ground.tangent(&disc.centre, 0.5 * wheel.radius)?;
            let frame = ContactFrame::of_wheel(&tangent.normal, &disc.axle, &disc.spoke);
            let (force, velocity) = (Vector3::from(own.force), Vector3::from(own.velocity));
            let rate = wheel
                .joint
                .map_or(0.0, |j| self.v()[model.joint_velocity(j)]);
            let rim = wheel.radius * wheel.drive_sign * rate;
            let (ahead, across) = (velocity.dot(&frame.t), velocity.dot(&frame.b));
            let faster = rim.abs().max(hypot(ahead, across)).max(SLIP_SPEED);
            Some(WheelContactInSand {
                wheel: i,
                sinkage: own.sinkage,
                frame,
                force: frame.rows().map(|d| force.dot(&d)),
                slip: hypot(ahead - rim, across) / faster,
            })
        });
        found.collect()
    }
}
