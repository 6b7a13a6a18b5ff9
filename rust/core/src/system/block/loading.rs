//! Rovers come into the lanes of a block, and leave them.

use std::sync::Arc;

use super::RoverBlock;
use super::lane_rover::LaneRover;
use crate::integrator::audit::note_energies;
use crate::sand::RutMap;
use crate::scalar::Lane;

impl<T: Lane> RoverBlock<T> {
    /// Gives a lane to a rover of this machine, with options alike those of the others.
    /// [`Self::begin`] follows.
    pub fn load_rover(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        let own = T::mask(self.data.token, 1 << lane);
        self.data.occupied = self.data.occupied | own;
        if !self.holds(lane, rover) {
            self.data.is_new = self.data.is_new | own;
            self.fill(lane, rover);
        }
        self.data.options.clone_from(rover.options);
        let system = &mut self.system;
        (system.friction).set(lane, rover.options.friction_coefficient);
        system.ground.set_lane(lane, rover.terrain);
        system.tree.load_tree(
            lane,
            (rover.model, rover.terrain),
            rover.options.gravity.into(),
            rover.command,
            rover.drive_work,
            rover.sand.as_deref_mut(),
        );
        self.data.time.set(lane, *rover.time);
        self.data.load_memory(lane, rover.warm_start);
    }

    /// Whether a lane has the inertia and the state of a rover, so that its energy is known.
    fn holds(&self, lane: usize, rover: &LaneRover<'_>) -> bool {
        let (tree, data) = (&self.system.tree, &self.data);
        let is_own = |own: &T, x: &f64| own.get(lane).to_bits() == x.to_bits();
        (tree.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, rover.model))
            && tree.gravity.get(lane).map(f64::to_bits)
                == <[f64; 3]>::from(rover.options.gravity).map(f64::to_bits)
            && data.v.iter().zip(&*rover.v).all(|(own, x)| is_own(own, x))
            && data.start.is_lane(lane, rover.configuration)
    }

    /// Gives a lane the state of a rover, and the friction of its joints.
    fn fill(&mut self, lane: usize, rover: &LaneRover<'_>) {
        let (system, joints) = (&mut self.system, rover.model.joints());
        for (own, &joint) in system.dry_friction.iter_mut().zip(&system.machine.rubbing) {
            own.set(lane, joints[joint].passive.friction);
        }
        self.data.start.set_lane(lane, rover.configuration);
        for (own, x) in self.data.v.iter_mut().zip(&*rover.v) {
            own.set(lane, *x);
        }
    }

    /// Writes a lane's state back, without its contacts.
    pub fn store_rover(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        let (tree, data) = (&mut self.system.tree, &self.data);
        tree.store_sand(lane, rover.sand.as_deref_mut());
        data.start.to_lane(lane, rover.configuration);
        for (x, own) in rover.v.iter_mut().zip(&data.v) {
            *x = own.get(lane);
        }
        *rover.time = data.time.get(lane);
        data.store_memory(lane, rover.warm_start);
        if let Some(loops) = &tree.loops {
            for (impulse, own) in rover.loop_impulses.iter_mut().zip(loops.impulses()) {
                *impulse = own.get(lane);
            }
        }
        let h = data.options.time_step;
        tree.drives.to_lane(lane, rover.drive_work);
        for (torque, wheel) in rover.wheel_torque.iter_mut().zip(rover.model.wheels()) {
            let impulse = wheel.joint.map_or(0.0, |j| tree.drives.impulse(lane, j));
            *torque = wheel.drive_sign * impulse * wheel.share / h;
        }
    }

    /// Empties a lane; its numbers stay, unused.
    pub fn clear(&mut self, lane: usize) {
        self.data.occupied = self.data.occupied & !T::mask(self.data.token, 1 << lane);
        self.system.tree.wrenches[lane].clear();
    }

    /// Follows after rovers were loaded.
    pub fn begin(&mut self) {
        self.system.tree.drives.finish_loading();
        note_energies(&mut self.system, &mut self.data);
    }

    /// Gives a rover that is not [stored](Self::store_rover) its ruts back.
    pub fn return_ruts(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        self.system
            .tree
            .return_ruts(lane, rover.sand.as_deref_mut());
    }

    /// Gives a rover its ruts back if the lane has them, after a panic.
    pub fn recover_ruts(&mut self, lane: usize, ruts: &mut RutMap) {
        self.system.tree.recover_ruts(lane, ruts);
    }
}
