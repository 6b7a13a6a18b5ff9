//! Which contacts a block's rovers have, and what is known of them.

use nalgebra::Vector3;

use super::{Block, Fallback};
use crate::contact::{Activation, Contact};
use crate::lanes::contacts::Sight;
use crate::lanes::joint_slots::JointRow;
use crate::scalar::{Lane, LaneMask};
use crate::solver::batch::problem::{ContactProblem, Triple};

impl<T: Lane> Block<T> {
    pub(super) fn detect(&mut self, problems: &mut [ContactProblem]) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        let (gravity, measured) = (self.gravity, (1.0 - theta) * h);
        let activation = Activation::of_step(gravity, h, self.options.forecast, measured);
        let sight = Sight {
            machine: &self.machine,
            models: &self.models,
            going: self.going.bits(),
            middle: &self.poses_middle,
            end: &self.poses_end,
            v: &self.v,
            needs_pieces: !self.options.materials.is_empty(),
            activation: &activation,
        };
        let fallbacks = self.contacts.detect(&mut self.ground, &sight);
        self.fall_back(Fallback::Contact, fallbacks);
        if self.machine.joints_with_slots().next().is_some() {
            let (machine, places) = (&*self.machine, (&self.middle, &self.end));
            let end = &self.poses_end;
            let too_many = self
                .contacts
                .detect_joints(machine, places, end, &self.v, &activation);
            self.fall_back(Fallback::Contact, too_many);
        }
        let elastic = self.number(self.options.restitution);
        let (zero, one) = (self.number(0.0), self.number(1.0));
        for &slot in self.contacts.used() {
            (self.mu[slot], self.restitution[slot]) = match self.contacts.joint_row(slot) {
                None => (self.friction, elastic),
                Some((_, JointRow::Stop(_))) => (zero, elastic),
                Some((_, JointRow::Friction)) => (one, zero),
            };
        }
        if !self.options.materials.is_empty() {
            self.mix_materials();
        }
        for lane in 0..T::LANES {
            let memory = &self.memories[lane];
            let own = (lane, self.models[lane].as_ref());
            (self.contacts).recall(own, memory, problems, &mut self.is_same);
        }
        let both = self.is_same.iter().zip(&self.has_persistent);
        for (persists, (is_same, has)) in self.persists.iter_mut().zip(both) {
            *persists = *is_same & *has;
        }
        self.contacts.intersect(&mut self.persists);
        self.contacts.unite(&mut self.is_gyroscopic);
    }

    /// Friction and restitution of contacts whose two materials have a law of their own.
    #[cold]
    fn mix_materials(&mut self) {
        for lane in (0..T::LANES).filter(|&lane| self.going.get(lane)) {
            let (Some(model), Some(terrain)) = (&self.models[lane], self.ground.terrain(lane))
            else {
                continue;
            };
            for (slot, contact) in self.contacts.all_of(&self.machine, lane) {
                let law = contact.between_materials(model, &**terrain, &self.options.materials);
                if let Some([mu, restitution]) = law {
                    self.mu[slot].set(lane, mu);
                    self.restitution[slot].set(lane, restitution);
                }
            }
        }
    }

    /// Visits the contacts of a lane's last step, in order: contact, position (world, m), impulse
    /// (N s) and local velocity (m/s).
    pub fn visit_contacts(
        &self,
        lane: usize,
        mut visit: impl FnMut(Contact, [f64; 3], [f64; 3], [f64; 3]),
    ) {
        for (slot, contact) in self.contacts.all_of(&self.machine, lane) {
            let at = |x: &[Triple<T>]| x[slot].map(|x| x.get(lane));
            let tree = self.machine.tree_of_body(contact.body);
            let origin = Vector3::from(self.poses_end.origin_of(tree).get(lane));
            let position = (origin + contact.point).into();
            visit(contact, position, at(&self.p), at(&self.u));
        }
    }
}
