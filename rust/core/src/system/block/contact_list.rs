//! Which contacts a block's rovers have.

use nalgebra::Vector3;

use super::RoverBlock;
use super::system::LaneSystem;
use crate::contact::slots::contacts::DetectionInput;
use crate::contact::slots::joint_slots::JointRow;
use crate::contact::{Activation, Contact};
use crate::integrator::StepOptions;
use crate::law::materials::Materials;
use crate::multibody::LaneConfiguration;
use crate::scalar::{Lane, LaneMask};
use crate::solver::batch::problem::Triple;

impl<T: Lane> LaneSystem<T> {
    /// Finds the contacts of the step, with their friction and restitution; `q`: at its middle and
    /// at its end. Returns the lanes that cannot have them.
    pub(super) fn find_contacts(
        &mut self,
        options: &StepOptions,
        q: (&LaneConfiguration<T>, &LaneConfiguration<T>),
        v: &[T],
        going: T::Mask,
    ) -> T::Mask {
        let (h, theta) = (options.time_step, options.theta);
        let measured = (1.0 - theta) * h;
        let activation = Activation::of_step(self.tree.gravity, h, options.forecast, measured);
        let input = DetectionInput {
            machine: &self.machine,
            models: &self.tree.models,
            going: going.bits(),
            middle: &self.tree.poses_middle,
            end: &self.tree.poses_end,
            v,
            needs_pieces: !options.materials.is_empty(),
            activation: &activation,
        };
        let mut refused = self.contacts.detect(&mut self.ground, &input);
        if self.machine.joints_with_slots().next().is_some() {
            let (machine, end) = (&*self.machine, &self.tree.poses_end);
            let too_many = (self.contacts).detect_joints(machine, q, end, v, &activation);
            refused = refused | too_many;
        }
        let elastic = self.number(options.restitution);
        let (zero, one) = (self.number(0.0), self.number(1.0));
        for &slot in self.contacts.used() {
            (self.mu[slot], self.restitution[slot]) = match self.contacts.joint_row(slot) {
                None => (self.friction, elastic),
                Some((_, JointRow::Stop(_))) => (zero, elastic),
                Some((_, JointRow::Friction)) => (one, zero),
            };
        }
        if !options.materials.is_empty() {
            self.mix_materials(&options.materials, going & !refused);
        }
        refused
    }

    /// Friction and restitution of contacts whose two materials have a law of their own.
    #[cold]
    fn mix_materials(&mut self, materials: &Materials, lanes: T::Mask) {
        for lane in (0..T::LANES).filter(|&lane| lanes.get(lane)) {
            let (Some(model), Some(terrain)) = (&self.tree.models[lane], self.ground.terrain(lane))
            else {
                continue;
            };
            for (slot, contact) in self.contacts.all_of(&self.machine, lane) {
                let law = contact.between_materials(model, &**terrain, materials);
                if let Some([mu, restitution]) = law {
                    self.mu[slot].set(lane, mu);
                    self.restitution[slot].set(lane, restitution);
                }
            }
        }
    }
}

impl<T: Lane> RoverBlock<T> {
    /// Visits the contacts of a lane's last step, in order: contact, position (world, m), impulse
    /// (N s) and local velocity (m/s).
    pub fn visit_contacts(
        &self,
        lane: usize,
        mut visit: impl FnMut(Contact, [f64; 3], [f64; 3], [f64; 3]),
    ) {
        let (own, data) = (&self.system, &self.data);
        for (slot, contact) in own.contacts.all_of(&own.machine, lane) {
            let at = |x: &[Triple<T>]| x[slot].map(|x| x.get(lane));
            let tree = own.machine.tree_of_body(contact.body);
            let origin = Vector3::from(own.tree.poses_end.origin_of(tree).get(lane));
            let position = (origin + contact.point).into();
            visit(contact, position, at(&data.p), at(&data.u));
        }
    }
}
