//! Joints at their stops: slots behind all others, the lower stop of a joint first.
//!
//! The formulas are those of [`crate::contact::limit`].

use super::contacts::Contacts;
use super::forecast::Forecast;
use super::machine::{Machine, SIDES, Stop};
use crate::contact::Side;
use crate::multibody::mechanism::LinkJoint;
use crate::multibody::{Place, Poses};
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Contacts<T> {
    /// The joint whose stop a slot is, and the side, if it is one.
    #[inline(always)]
    pub(super) fn stop(&self, slot: usize) -> Option<(&Stop, Side)> {
        let own = slot.checked_sub(self.first_stop)?;
        let side = if own.is_multiple_of(SIDES) {
            Side::Lower
        } else {
            Side::Upper
        };
        self.stops.get(own / SIDES).map(|stop| (stop, side))
    }

    /// Finds the stops that a step must consider, after the other contacts.
    ///
    /// `middle` and `end`: configurations at the midpoint of the step, where gaps are measured, and
    /// at its predicted end. `poses`: at its end; `v`: velocity (nv) before the step. Returns the
    /// lanes that have too many contacts.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn detect_stops(
        &mut self,
        machine: &Machine,
        (middle, end): (&Place<T>, &Place<T>),
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
                    let axis = match link.joint {
                        LinkJoint::Slide(_) => motion.swing,
                        _ => motion.axis,
                    };
                    for (k, side) in [Side::Lower, Side::Upper].into_iter().enumerate() {
                        let sign = v[own.velocity].like(side.sign());
                        let gap = |q: T| match side {
                            Side::Lower => q - q.like(limits.lower),
                            Side::Upper => q.like(limits.upper) - q,
                        };
                        let slot = self.first_stop + SIDES * i + k;
                        let contact = &mut self.slots[slot];
                        let rate = sign * v[own.velocity];
                        contact.active = forecast.admits(gap(middle.joints[joint]), rate);
                        if !contact.active.any() {
                            continue;
                        }
                        contact.gap = gap(end.joints[joint]);
                        contact.point = poses.bodies[own.body].r;
                        contact.n = axis * sign;
                        self.used.push(slot);
                        too_many = too_many | self.list_slot(slot, None);
                    }
                }
                self.choose_forms();
                too_many
            },
        )
    }
}
