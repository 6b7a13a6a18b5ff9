//! Contact points and forces of a rover on the ground.

use super::rover::RoverSimulation;
use crate::contact::detection::{deepest_overlap, wheel_contacts};
use nalgebra::Vector3;

use super::active_contact::ActiveContact;
use super::rover_sand::WheelContactInSand;
use crate::contact::part::place_wheel;
use crate::contact::{Contact, ContactFrame, Opposite, Part};

type RoverContact = ActiveContact<Contact>;

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

    /// Mean contact force of the last step on every wheel along its frame's n, t, b, N; that of
    /// sand is included.
    ///
    /// Several contacts of one wheel are summed in the frame of its first; where grains are among
    /// them, in that of their mean normal, weighted by the normal impulses.
    #[must_use]
    pub fn wheel_forces(&self) -> Vec<[f64; 3]> {
        let mut forces = WheelForces::default();
        forces.sum(self);
        forces.add_sand(&self.wheels_in_sand());
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
        let is_grain = |a: &RoverContact| matches!(a.contact.key.opposite, Opposite::Grain(_));
        if rover.active.iter().any(is_grain) {
            self.turn_to_mean_normals(rover);
        }
    }

    /// Adds the forces of sand, in the frame of a wheel's contact where it has one.
    pub(super) fn add_sand(&mut self, in_sand: &[WheelContactInSand]) {
        for contact in in_sand {
            let i = contact.wheel;
            let own = contact.frame.rows();
            let force = (0..3).map(|k| own[k] * contact.force[k]);
            let force = force.fold(Vector3::zeros(), |sum, part| sum + part);
            let frame = self.frames[i].get_or_insert(contact.frame);
            for (along, d) in self.along[i].iter_mut().zip(frame.rows()) {
                *along += force.dot(&d);
            }
        }
    }

    /// Expresses the forces in frames of the wheels' mean normals.
    fn turn_to_mean_normals(&mut self, rover: &RoverSimulation) {
        let kinematics = rover.kinematics();
        for (i, wheel) in rover.model().wheels().iter().enumerate() {
            let of_wheel = rover.active.iter();
            let of_wheel = of_wheel.filter(|a| a.contact.part == Part::Wheel(i));
            let pushes = of_wheel.map(|a| a.contact.frame.n * a.impulse[0]);
            let sum = pushes.fold(Vector3::zeros(), |sum, push| sum + push);
            let (Some(n), Some(old)) = (sum.try_normalize(0.0), self.frames[i]) else {
                continue;
            };
            let disc = place_wheel(wheel, &kinematics);
            let new = ContactFrame::of_wheel(&n, &disc.axle, &disc.spoke);
            let along = self.along[i];
            let force = (0..3).map(|k| old.rows()[k] * along[k]);
            let force = force.fold(Vector3::zeros(), |sum, part| sum + part);
            self.along[i] = new.rows().map(|d| force.dot(&d));
        }
    }
}
