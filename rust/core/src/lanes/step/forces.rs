//! The velocity without contact impulses.

use super::Block;
use crate::multibody::bias::bias;
use crate::scalar::{Lane, LaneMask};

/// A velocity at which forces are evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) enum At {
    /// Before the step.
    Start,
    /// In its mean.
    Mean,
}

impl<T: Lane> Block<T> {
    /// The implicit terms of motors, held joints, springs and dampers; `is_first`: their branches
    /// and weights, too.
    #[inline(always)]
    pub(super) fn add_implicit(&mut self, is_first: bool) {
        let machine = &*self.machine;
        let (h, theta) = self.time_step();
        let mass_matrix = &mut self.mass_matrix;
        if is_first {
            self.drives.choose_branches(machine, &self.v);
            let inertia = |k| mass_matrix.diagonal(machine, k);
            self.drives.set_theta(machine, (h, theta), inertia);
        }
        self.drives.add_implicit(machine, (h, theta), |k, a| {
            mass_matrix.add_to_diagonal(machine, k, a);
        });
    }

    /// The free change of the velocity, `y` in factor coordinates, and the contacts' free velocity
    /// `u`: first with the forces at v, then with those at the mean velocity that follows from them
    /// and from the last step's impulses.
    pub(super) fn load(&mut self) {
        let token = self.token;
        let persists = self.any(&self.persists);
        let is_any = (persists & self.going).any();
        T::vectorize(
            token,
            #[inline(always)]
            || self.push_and_drive(is_any, persists),
        );
        self.load_implicitly(is_any);
        if self.is_any_explicit() {
            self.weigh(Some(At::Start));
            T::vectorize(
                token,
                #[inline(always)]
                || self.add_torque_and_pushed(is_any),
            );
            self.weigh(Some(At::Mean));
            T::vectorize(
                token,
                #[inline(always)]
                || self.add_torque_and_correction(is_any),
            );
        }
        T::vectorize(
            token,
            #[inline(always)]
            || self.finish_load(),
        );
    }

    #[inline(always)]
    fn push_and_drive(&mut self, is_any: bool, persists: T::Mask) {
        let zero = self.number(0.0);
        let step = self.time_step();
        if is_any {
            let (contacts, end) = (&self.contacts, &self.poses_end);
            self.rows.generalized_impulse(
                &self.machine,
                contacts,
                end,
                persists,
                &self.p_last,
                &mut self.pushed,
            );
        }
        self.torque.fill(zero);
        self.drives.add_impulse(
            &self.machine,
            step,
            &self.start.joints,
            [&self.v, &self.v],
            &mut self.torque,
        );
        if let Some(sand) = &self.sand {
            sand.add_impulse(self.options.time_step, &self.v, &mut self.torque);
        }
        self.push(step.0);
    }

    /// `y` = the bias at a velocity; at rest, with `None`, it is that of gravity.
    pub(super) fn weigh(&mut self, at: Option<At>) {
        let v = match at {
            Some(At::Start) => &self.v,
            Some(At::Mean) => &self.v_mean,
            None => {
                self.v_mean.fill(T::splat(self.token, 0.0));
                &self.v_mean
            }
        };
        bias(
            &self.machine,
            &self.inertias,
            &self.poses_middle,
            v,
            self.gravity,
            &mut self.bias_scratch,
            &mut self.y,
        );
    }

    #[inline(always)]
    fn add_torque_and_pushed(&mut self, is_any: bool) {
        let (h, theta) = self.time_step();
        let share = h.like(1.0) - theta;
        let pushed = self.pushed.iter().zip(&self.cluster_of);
        for ((y, torque), (pushed, cluster)) in self.y.iter_mut().zip(&self.torque).zip(pushed) {
            *y = *torque - h * *y;
            if is_any {
                *y = T::select(self.persists[*cluster], *y + *pushed, *y);
            }
        }
        self.factor.half_solve(&self.machine, &mut self.y);
        self.close_loops();
        self.factor.half_solve_back(&self.machine, &mut self.y);
        for ((mean, v), change) in self.v_mean.iter_mut().zip(&self.v).zip(&self.y) {
            *mean = *v + share * *change;
        }
    }

    #[inline(always)]
    fn add_torque_and_correction(&mut self, is_any: bool) {
        let (h, _) = self.time_step();
        for (y, torque) in self.y.iter_mut().zip(&self.torque) {
            *y = *torque - h * *y;
        }
        self.correct_impulse(is_any);
    }

    /// The contacts' free velocity from the free change of the velocity.
    #[inline(always)]
    fn finish_load(&mut self) {
        let (h, _) = self.time_step();
        self.take_implicit();
        self.close_loops();
        self.rows.local(&self.contacts, &self.y, &mut self.u);
        self.yields.shift(&self.contacts, &mut self.u);
        self.rebound(h.like(1.0));
        self.hold_joints(-h);
    }

    /// Adds the deferred correction r to the impulse `y`, and turns it into factor coordinates.
    #[inline(always)]
    pub(super) fn correct_impulse(&mut self, is_any: bool) {
        let (h, theta) = self.time_step();
        let share = h.like(1.0) - theta;
        let pushed = self.pushed.iter().zip(&self.persistent);
        let pushed = pushed.zip(&self.cluster_of);
        for (y, ((pushed, before), cluster)) in self.y.iter_mut().zip(pushed).filter(|_| is_any) {
            let persists = self.persists[*cluster];
            *y = T::select(persists, *y + share * (*before - *pushed), *y);
        }
        self.factor.half_solve(&self.machine, &mut self.y);
    }

    /// Makes the free change of the velocity obey the loops.
    #[inline(always)]
    pub(super) fn close_loops(&mut self) {
        if let Some(loops) = &mut self.rows.loops {
            loops.close(self.options.theta, &self.v, &self.v, &mut self.y);
        }
    }

    /// Adds the most friction that a joint has in `duration` to its normal velocity, as
    /// [`crate::contact::joint_friction`] says.
    #[inline(always)]
    pub(super) fn hold_joints(&mut self, duration: T) {
        let slots = self.contacts.slots_of_friction();
        for (slot, most) in slots.zip(&self.dry_friction) {
            self.u[slot][0] += duration * *most * self.rows.normal[slot];
        }
    }
}
