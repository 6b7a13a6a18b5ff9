//! Slots of joints, behind all others: one for the two ends of a range, and one for dry friction.
//!
//! The formulas are those of [`crate::contact::limit`] and [`crate::contact::joint_friction`].

use std::ops::Range;

use super::contacts::ContactSlots;
use super::machine::{SharedMachine, Stop};
use crate::contact::rows::close_stop;
use crate::contact::{Activation, ContactKey, Part, Side, joint_friction};
use crate::multibody::{JointModel, LaneConfiguration, Poses};
use crate::scalar::{Lane, LaneMask, inlined};

/// What a joint's slot is for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum JointRow<T> {
    /// Stops of the joint, and the end that is active in each lane: 1 the lower, −1 the upper.
    Stop(T),
    /// Dry friction of the joint.
    Friction,
}

impl<T: Lane> JointRow<T> {
    /// The only row of H that is not zero, and its entry at the joint's velocity.
    #[inline(always)]
    pub(crate) fn entry(self, zero: T) -> (usize, T) {
        match self {
            Self::Stop(end) => (0, end),
            Self::Friction => (1, zero.like(1.0)),
        }
    }

    /// Makes the own block of W regular.
    #[inline(always)]
    pub(crate) fn close(self, own: &mut [T; 9]) {
        match self {
            Self::Stop(_) => close_stop(own),
            Self::Friction => joint_friction::close(own),
        }
    }

    /// The part and the key of a lane's contact.
    #[inline(always)]
    pub(crate) fn names(self, joint: usize, lane: usize) -> (Part, ContactKey) {
        match self {
            Self::Stop(end) => {
                let side = if end.get(lane) > 0.0 {
                    Side::Lower
                } else {
                    Side::Upper
                };
                (Part::Limit(joint, side), ContactKey::at_limit(joint, side))
            }
            Self::Friction => (Part::Friction(joint), ContactKey::of_friction(joint)),
        }
    }
}

impl<T: Lane> ContactSlots<T> {
    /// The joint that a slot is for, if it is, and what for.
    #[inline(always)]
    pub(crate) fn joint_row(&self, slot: usize) -> Option<(usize, JointRow<T>)> {
        let own = slot.checked_sub(self.first_of_joints)?;
        Some(match self.stops.get(own) {
            Some(stop) => (stop.joint, JointRow::Stop(self.ends[own])),
            None => (self.rubbing[own - self.stops.len()], JointRow::Friction),
        })
    }

    /// Slots of the joints with dry friction.
    #[inline(always)]
    pub(crate) fn slots_of_friction(&self) -> Range<usize> {
        self.first_of_joints + self.stops.len()..self.slots.len()
    }

    /// Finds the stops that a step must consider, and the joints with dry friction, after the other
    /// contacts.
    ///
    /// `middle` and `end`: configurations at the midpoint of the step, where gaps are measured, and
    /// at its predicted end. `poses`: at its end; `v`: velocity (nv) before the step. Returns the
    /// lanes that have too many contacts, or a joint that may reach both ends in this step.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn detect_joints(
        &mut self,
        machine: &SharedMachine,
        (middle, end): (&LaneConfiguration<T>, &LaneConfiguration<T>),
        poses: &Poses<T>,
        v: &[T],
        activation: &Activation<T>,
    ) -> T::Mask {
        inlined!(T::vectorize, self.token, {
            let mut too_many = T::mask(self.token, 0);
            for i in 0..self.stops.len() {
                let Stop { joint, limits } = self.stops[i];
                let own = machine.joints[joint];
                let link = &machine.links[own.body];
                let motion = &poses.motions[link.motion];
                let axis = link.joint.direction(motion);
                let gaps = |q: T| [q - q.like(limits.lower), q.like(limits.upper) - q];
                let [lower, upper] = gaps(middle.joints[joint]);
                let rate = v[own.velocity];
                let arm = rate.like(own.arm);
                let is_low = activation.admits(arm * lower, || arm * rate);
                let is_high = activation.admits(arm * upper, || -(arm * rate));
                let active = is_low | is_high;
                let both = is_low & is_high;
                too_many = too_many | both;
                let slot = self.first_of_joints + i;
                let contact = &mut self.slots[slot];
                contact.active = active & !both;
                if !contact.active.any() {
                    continue;
                }
                let (zero, one) = (rate.like(0.0), rate.like(1.0));
                let end_of_range = T::select(is_low, one, -one);
                let end_of_range = T::select(active, end_of_range, zero);
                self.ends[i] = end_of_range;
                let [lower, upper] = gaps(end.joints[joint]);
                contact.gap = T::select(is_low, lower, upper);
                contact.point = poses.bodies[own.body].r;
                contact.n = axis * end_of_range;
                self.used.push(slot);
                too_many = too_many | self.list_slot(slot, None);
            }
            too_many = too_many | self.list_friction(machine, poses);
            self.choose_forms();
            too_many
        })
    }

    /// Lists the joints with dry friction. Returns the lanes that have too many contacts.
    #[inline(always)]
    fn list_friction(&mut self, machine: &SharedMachine, poses: &Poses<T>) -> T::Mask {
        let mut too_many = T::mask(self.token, 0);
        for (slot, &joint) in self.slots_of_friction().zip(&machine.rubbing) {
            let own = machine.joints[joint];
            let link = &machine.links[own.body];
            let contact = &mut self.slots[slot];
            contact.active = T::mask(self.token, u32::MAX >> (32 - T::LANES));
            contact.gap = T::splat(self.token, 0.0);
            contact.point = poses.bodies[own.body].r;
            contact.n = link.joint.direction(&poses.motions[link.motion]);
            self.used.push(slot);
            too_many = too_many | self.list_slot(slot, None);
        }
        too_many
    }
}
