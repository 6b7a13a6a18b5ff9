//! Contact points and forces of a rover on the ground.

use super::rover::RoverSimulation;
use crate::contact::detection::{deepest_overlap, wheel_contacts};

use super::rover_sand::WheelContactInSand;
use crate::contact::{Contact, Part};

impl RoverSimulation {
    /// Current nearest point, frame and gap of every wheel.
    #[must_use]
    pub fn wheel_contacts(&self) -> Vec<Contact> {
        wheel_contacts(self.model(), &self.kinematics(), &**self.terrain())
    }

    /// Deepest gap of any part with the ground now, m; 0 where nothing overlaps.
    #[must_use]
    pub fn deepest_overlap(&self) -> f64 {
        deepest_overlap(self.model(), &self.kinematics(), &**self.terrain())
    }

    /// Mean contact force of the last step on every wheel, N; that of sand is included.
    ///
    /// A sum over its contacts, each along its own normal, rolling and lateral direction, so that
    /// the first is never negative.
    #[must_use]
    pub fn wheel_forces(&self) -> Vec<[f64; 3]> {
        let mut forces = Vec::new();
        self.sum_wheel_forces(&self.wheels_in_sand(), &mut forces);
        forces
    }

    /// The same; `in_sand`: [`Self::wheels_in_sand`].
    pub(super) fn sum_wheel_forces(
        &self,
        in_sand: &[WheelContactInSand],
        forces: &mut Vec<[f64; 3]>,
    ) {
        forces.clear();
        forces.resize(self.model().wheels().len(), [0.0; 3]);
        for active in &self.active {
            if let Part::Wheel(i) = active.contact.part {
                for (force, impulse) in forces[i].iter_mut().zip(active.impulse) {
                    *force += impulse / self.options.time_step;
                }
            }
        }
        for contact in in_sand {
            for (force, own) in forces[contact.wheel].iter_mut().zip(contact.force) {
                *force += own;
            }
        }
    }

    /// Mean normal force of the last step on all parts except wheels, N, without joints' stops.
    #[must_use]
    pub fn body_force(&self) -> f64 {
        let boxes = self.active.iter().filter(|a| {
            matches!(
                a.contact.part,
                Part::Box(_) | Part::Sphere(_) | Part::Collider(_)
            )
        });
        boxes.map(|a| a.impulse[0]).sum::<f64>() / self.options.time_step
    }
}
