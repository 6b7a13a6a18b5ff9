//! Outputs of a unit, each computed when it is first asked for.

use std::cell::OnceCell;

use rover_core::multibody::{Energy, coordinates};
use rover_core::simulation::RoverSimulation;

use crate::inertial::unaccelerated;
use crate::scene_file::Channel;
use crate::state::LastStep;

/// The outputs of one call.
pub struct Reading<'a> {
    rover: &'a RoverSimulation,
    last: &'a LastStep,
    gravity: [f64; 3],
    q: OnceCell<Vec<f64>>,
    gaps: OnceCell<Vec<f64>>,
    forces: OnceCell<Vec<[f64; 3]>>,
    energy: OnceCell<Energy>,
}

impl<'a> Reading<'a> {
    pub fn new(rover: &'a RoverSimulation, last: &'a LastStep, gravity: [f64; 3]) -> Self {
        Self {
            rover,
            last,
            gravity,
            q: OnceCell::new(),
            gaps: OnceCell::new(),
            forces: OnceCell::new(),
            energy: OnceCell::new(),
        }
    }

    /// An entry of an output; `None` where there is none.
    pub fn get(&self, channel: Channel, index: usize) -> Option<f64> {
        let rover = self.rover;
        let energy = || self.energy.get_or_init(|| rover.energy());
        Some(match channel {
            Channel::Q => *self.q().get(index)?,
            Channel::V => *rover.v().get(index)?,
            Channel::Attitude => {
                let attitude = rover.q().attitude.quaternion();
                let [x, y, z, w] = attitude.coords.into();
                *[w, x, y, z].get(index)?
            }
            Channel::WheelGap => *self.gaps().get(index)?,
            Channel::WheelForce => *self.forces().get(index / 3)?.get(index % 3)?,
            Channel::MotorTorque => *rover.motor_torques().get(index)?,
            Channel::TrunkForce => rover.body_force(),
            Channel::Inertial => {
                let readings = self.last.inertial;
                let readings = readings.unwrap_or_else(|| unaccelerated(rover, self.gravity));
                *readings.get(index)?
            }
            Channel::KineticEnergy => energy().kinetic,
            Channel::PotentialEnergy => energy().potential,
            Channel::Contacts => self.last.contacts,
            Channel::SolverResidual => self.last.residual,
            Channel::SolverIterations => self.last.iterations,
            _ => return None,
        })
    }

    fn q(&self) -> &[f64] {
        (self.q).get_or_init(|| coordinates::to_public(self.rover.model(), self.rover.q()))
    }

    fn gaps(&self) -> &[f64] {
        self.gaps.get_or_init(|| {
            let contacts = self.rover.wheel_contacts();
            contacts.iter().map(|contact| contact.gap).collect()
        })
    }

    fn forces(&self) -> &[[f64; 3]] {
        self.forces.get_or_init(|| self.rover.wheel_forces())
    }
}
