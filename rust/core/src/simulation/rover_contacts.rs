//! Contact points and forces of a rover on the ground.

use nalgebra::Vector3;

use super::active_contact::ActiveContact;
use super::rover::RoverSimulation;
use super::rover_sand::WheelContactInSand;
use crate::contact::detection::{deepest_overlap, wheel_contacts};
use crate::contact::rollers::across_of;
use crate::contact::{Contact, ContactFrame, OtherSide, Part};
use crate::geometry::query::PairPoint;
use crate::multibody::{Kinematics, Model};

impl ActiveContact<Contact> {
    /// The contact along unit vectors, where its friction across differs from that along: the
    /// solver's tangent b is then scaled by their ratio.
    #[must_use]
    pub fn with_unit_axes(&self, model: &Model) -> Self {
        let mut own = *self;
        let across = across_of(model, &self.contact).filter(|across| *across > 0.0);
        if let Some(across) = across {
            own.contact.frame.b /= across;
            own.impulse[2] *= across;
            own.velocity[2] /= across;
        }
        own
    }
}

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

    /// Writes [`Self::wheel_forces`] to `forces`, N. `in_sand`: [`Self::wheels_in_sand`].
    pub(super) fn sum_wheel_forces(
        &self,
        in_sand: &[WheelContactInSand],
        forces: &mut Vec<[f64; 3]>,
    ) {
        forces.clear();
        forces.resize(self.model().wheels().len(), [0.0; 3]);
        let mut add = |wheel: usize, own: [f64; 3]| {
            for (force, own) in forces[wheel].iter_mut().zip(own) {
                *force += own;
            }
        };
        self.for_each_wheel_contact(|wheel, impulse, _| {
            add(wheel, impulse.map(|p| p / self.options.time_step));
        });
        for contact in in_sand {
            add(contact.wheel, contact.force);
        }
    }

    /// Calls `act` with the wheel, the impulse on it and its velocity relative to the other side,
    /// for every contact of a wheel in the last step. Between two wheels each has its own frame,
    /// with the normal towards it.
    pub(super) fn for_each_wheel_contact(&self, mut act: impl FnMut(usize, [f64; 3], [f64; 3])) {
        let mut kinematics = None;
        for active in &self.active {
            let active = &active.with_unit_axes(self.model());
            if let Part::Wheel(i) = active.contact.part {
                act(i, active.impulse, active.velocity);
            }
            if let Some(other) = active.contact.other
                && let Part::Wheel(i) = other.part
            {
                let kinematics = kinematics.get_or_insert_with(|| self.kinematics());
                let frame = self.frame_on_other(kinematics, active, other);
                let on_other = |x: [f64; 3]| {
                    let axes = active.contact.frame.rows().into_iter().zip(x);
                    let opposite: Vector3<f64> = axes.map(|(axis, x)| axis * -x).sum();
                    frame.rows().map(|axis| axis.dot(&opposite))
                };
                act(i, on_other(active.impulse), on_other(active.velocity));
            }
        }
    }

    /// Frame of a contact of two bodies as the other one sees it, with the normal towards that.
    fn frame_on_other(
        &self,
        kinematics: &Kinematics,
        active: &ActiveContact<Contact>,
        OtherSide { part, body }: OtherSide,
    ) -> ContactFrame {
        let pose = (&kinematics.R(body), &kinematics.r(body));
        let shape = part.place_at(self.model(), pose);
        let point = PairPoint {
            point: active.position.into(),
            n: -active.contact.frame.n,
            gap: active.contact.gap,
            feature: 0,
        };
        ContactFrame::of_pair(&shape.moved(kinematics.origin(body)), &point)
    }

    /// Mean normal force of the last step on all parts except wheels, N, without joints' stops.
    #[must_use]
    pub fn body_force(&self) -> f64 {
        let is_body =
            |part: Part| matches!(part, Part::Box(_) | Part::Sphere(_) | Part::Collider(_));
        let on_bodies = self.active.iter().filter_map(|active| {
            let other = active
                .contact
                .other
                .is_some_and(|other| is_body(other.part));
            let n = u8::from(is_body(active.contact.part)) + u8::from(other);
            (n > 0).then(|| f64::from(n) * active.impulse[0])
        });
        on_bodies.sum::<f64>() / self.options.time_step
    }
}
