//! Rovers come into the lanes of a block, and leave them.

use std::sync::Arc;

use super::balance::select_both;
use super::{Block, State};
use crate::lanes::lane_rover::LaneRover;
use crate::scalar::{Lane, LaneMask};

impl<T: Lane> Block<T> {
    /// Gives a lane to a rover of this machine, with options alike those of the others.
    /// [`Self::begin`] follows.
    pub fn load_rover(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        let own = T::mask(self.token, 1 << lane);
        self.occupied = self.occupied | own;
        if !self.holds(lane, rover) {
            self.is_new = self.is_new | own;
            self.fill(lane, rover);
        }
        self.options.clone_from(rover.options);
        self.friction.set(lane, rover.options.friction_coefficient);
        self.ground.set_lane(lane, rover.terrain);
        self.load_sand(lane, rover);
        self.wrenches[lane].clone_from(&rover.command.wrenches);
        let joints = rover.model.joints();
        self.drives.set_lane(lane, joints, rover.command);
        self.drives.set_work(lane, rover.drive_work);
        self.time.set(lane, *rover.time);
        let memory = &mut self.memories[lane];
        memory.impulses.clone_from(&rover.warm_start.impulses);
        memory.stored.clone_from(&rover.warm_start.stored);
        let persistent = &rover.warm_start.persistent;
        for (own, x) in self.persistent.iter_mut().zip(persistent) {
            own.set(lane, *x);
        }
        let is_one = self.n_clusters() == 1;
        for (cluster, has) in self.has_persistent.iter_mut().enumerate() {
            *has = *has & !own;
            // Of several clusters, those that did not persist have zeros.
            let mut all = persistent.iter().zip(&self.cluster_of);
            if !persistent.is_empty() && (is_one || all.any(|(x, of)| *of == cluster && *x != 0.0))
            {
                *has = *has | own;
            }
        }
    }

    /// Whether a lane has the inertia and the state of a rover, so that its energy is known.
    fn holds(&self, lane: usize, rover: &LaneRover<'_>) -> bool {
        let is_own = |own: &T, x: &f64| own.get(lane).to_bits() == x.to_bits();
        (self.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, rover.model))
            && self.gravity.get(lane).map(f64::to_bits)
                == <[f64; 3]>::from(rover.options.gravity).map(f64::to_bits)
            && self.v.iter().zip(&*rover.v).all(|(own, x)| is_own(own, x))
            && self.start.is_lane(lane, rover.configuration)
    }

    /// Gives a lane the inertia and the state of a rover.
    fn fill(&mut self, lane: usize, rover: &LaneRover<'_>) {
        if !(self.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, rover.model)) {
            self.inertias.set_lane(lane, rover.model.inertias());
            let joints = rover.model.joints();
            for (own, &joint) in self.dry_friction.iter_mut().zip(&self.machine.rubbing) {
                own.set(lane, joints[joint].passive.friction);
            }
            self.models[lane] = Some(Arc::clone(rover.model));
        }
        self.gravity.set(lane, rover.options.gravity.into());
        self.start.set_lane(lane, rover.configuration);
        for (own, x) in self.v.iter_mut().zip(&*rover.v) {
            own.set(lane, *x);
        }
    }

    /// Writes a lane's state back, without its contacts.
    pub fn store_rover(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        self.store_sand(lane, rover);
        self.start.to_lane(lane, rover.configuration);
        for (x, own) in rover.v.iter_mut().zip(&self.v) {
            *x = own.get(lane);
        }
        *rover.time = self.time.get(lane);
        let memory = &self.memories[lane];
        rover.warm_start.impulses.clone_from(&memory.impulses);
        rover.warm_start.stored.clone_from(&memory.stored);
        rover.warm_start.persistent.clear();
        if self.any(&self.has_persistent).get(lane) {
            let persistent = self.persistent.iter().zip(&self.cluster_of);
            let persistent = persistent.map(|(x, cluster)| {
                if self.has_persistent[*cluster].get(lane) {
                    x.get(lane)
                } else {
                    0.0
                }
            });
            rover.warm_start.persistent.extend(persistent);
        }
        if let Some(loops) = &self.rows.loops {
            for (impulse, own) in rover.loop_impulses.iter_mut().zip(loops.impulses()) {
                *impulse = own.get(lane);
            }
        }
        let h = self.options.time_step;
        self.drives.to_lane(lane, rover.drive_work);
        for (torque, wheel) in rover.wheel_torque.iter_mut().zip(rover.model.wheels()) {
            let impulse = wheel.joint.map_or(0.0, |j| self.drives.impulse(lane, j));
            *torque = wheel.drive_sign * impulse * wheel.share / h;
        }
    }

    /// Empties a lane; its numbers stay, unused.
    pub fn clear(&mut self, lane: usize) {
        self.occupied = self.occupied & !T::mask(self.token, 1 << lane);
        self.wrenches[lane].clear();
    }

    /// Follows after rovers were loaded.
    pub fn begin(&mut self) {
        self.drives.finish_loading();
        let is_new = self.is_new;
        if is_new.any() {
            let mut found = std::mem::take(&mut self.energies);
            for (before, own) in found.before.iter_mut().zip(self.energy(State::Start)) {
                *before = select_both(is_new, own.energy.kinetic_and_potential(), *before);
            }
            self.energies = found;
            self.is_new = T::mask(self.token, 0);
        }
    }
}
