//! Contact points and forces of a rover on the ground.

use super::rover::RoverSimulation;
use crate::contact::detection::{deepest_overlap, wheel_contacts};
use crate::contact::{Contact, ContactFrame, Part};

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

    /// Mean contact force of the last step on every wheel along its frame's n, t, b, N.
    ///
    /// Several contacts of one wheel are summed in the frame of its first.
    #[must_use]
    pub fn wheel_forces(&self) -> Vec<[f64; 3]> {
        let mut forces = WheelForces::default();
        forces.sum(self);
        forces.along
    }

    /// Mean normal force of the last step on all parts except wheels, N, without joints' stops.
    #[must_use]
    pub fn body_force(&self) -> f64 {
        let boxes = self
            .active
            .iter()
            .filter(|a| !matches!(a.contact.part, Part::Wheel(_) | Part::Limit(..)));
        boxes.map(|a| a.impulse[0]).sum::<f64>() / self.options.time_step
    }
}

/// Contact forces of wheels: scratch.
#[derive(Debug, Default)]
pub(super) struct WheelForces {
    /// Force on every wheel along n, t, b, N.
    pub(super) along: Vec<[f64; 3]>,
    frames: Vec<Option<ContactFrame>>,
}

impl WheelForces {
    /// The forces that [`RoverSimulation::wheel_forces`] gives.
    pub(super) fn sum(&mut self, rover: &RoverSimulation) {
        let n_wheels = rover.model().wheels().len();
        self.along.clear();
        self.along.resize(n_wheels, [0.0; 3]);
        self.frames.clear();
        self.frames.resize(n_wheels, None);
        for active in &rover.active {
            if let Part::Wheel(i) = active.contact.part {
                let [n, t, b] = active.contact.frame.rows();
                let [p_n, p_t, p_b] = active.impulse;
                let impulse = n * p_n + t * p_t + b * p_b;
                let frame = self.frames[i].get_or_insert(active.contact.frame);
                for (force, d) in self.along[i].iter_mut().zip(frame.rows()) {
                    *force += impulse.dot(&d) / rover.options.time_step;
                }
            }
        }
    }
}
