//! Outputs of a unit, each computed when it is first asked for.

use std::cell::OnceCell;

use rover_core::multibody::{Energy, coordinates};
use rover_core::simulation::RoverSimulation;

use crate::inertial::unaccelerated;
use crate::scene_file::VariableKind;
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
    pub fn get(&self, channel: VariableKind, index: usize) -> Option<f64> {
        let rover = self.rover;
        let energy = || self.energy.get_or_init(|| rover.energy());
        Some(match channel {
            VariableKind::Q => *self.q().get(index)?,
            VariableKind::V => *rover.v().get(index)?,
            VariableKind::Attitude => {
                let attitude = rover.q().attitude.quaternion();
                let [x, y, z, w] = attitude.coords.into();
                *[w, x, y, z].get(index)?
            }
            VariableKind::WheelGap => *self.gaps().get(index)?,
            VariableKind::WheelForce => *self.forces().get(index / 3)?.get(index % 3)?,
            VariableKind::MotorTorque => *rover.motor_torques().get(index)?,
            VariableKind::TrunkForce => rover.body_force(),
            VariableKind::Inertial => {
                let readings = self.last.inertial;
                let readings = readings.unwrap_or_else(|| unaccelerated(rover, self.gravity));
                *readings.get(index)?
            }
            VariableKind::KineticEnergy => energy().kinetic,
            VariableKind::PotentialEnergy => energy().potential,
            VariableKind::Contacts => self.last.contacts,
            VariableKind::SolverResidual => self.last.residual,
            VariableKind::SolverIterations => self.last.iterations,
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
