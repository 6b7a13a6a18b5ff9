//! Joints at their stops: slots behind all others, one for the two ends of a range.
//!
//! The formulas are those of [`crate::contact::limit`].

use super::contacts::Contacts;
use super::forecast::Forecast;
use super::machine::{Machine, Stop};
use crate::multibody::{JointModel, LaneConfiguration, Poses};
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Contacts<T> {
    /// The joint whose stops a slot is for, if it is, and at which end each lane's is: 1 at the
    /// lower, −1 at the upper.
    #[inline(always)]
    pub(super) fn stop(&self, slot: usize) -> Option<(&Stop, T)> {
        let own = slot.checked_sub(self.first_stop)?;
        self.stops.get(own).map(|stop| (stop, self.ends[own]))
    }

    /// Finds the stops that a step must consider, after the other contacts.
    ///
    /// `middle` and `end`: configurations at the midpoint of the step, where gaps are measured, and
    /// at its predicted end. `poses`: at its end; `v`: velocity (nv) before the step. Returns the
    /// lanes that have too many contacts, or a joint that may reach both ends in this step.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn detect_stops(
        &mut self,
        machine: &Machine,
        (middle, end): (&LaneConfiguration<T>, &LaneConfiguration<T>),
        poses: &Poses<T>,
        v: &[T],
        forecast: &Forecast<T>,
    ) -> T::Mask {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
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
                    let is_low = forecast.admits(lower, rate);
                    let is_high = forecast.admits(upper, -rate);
                    let active = is_low | is_high;
                    let both = is_low & is_high;
                    too_many = too_many | both;
                    let slot = self.first_stop + i;
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
                self.choose_forms();
                too_many
            },
        )
    }
}
