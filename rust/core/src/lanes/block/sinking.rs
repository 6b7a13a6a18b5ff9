//! The sand under the wheels in a step: [`crate::system::sand`].

use super::Block;
use super::system::LaneSystem;
use crate::integrator::{MOST_REVISIONS, StepOptions};
use crate::lanes::lane_rover::LaneRover;
use crate::sand::RutMap;
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::system::sand::{MOST_REVISIONS_IN_SAND, SandContact};
use crate::system::sand_patch::{Layers, SandScene};

impl<T: Lane> LaneSystem<T> {
    /// Takes over the sand of a rover, and its ruts.
    pub(super) fn load_sand(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        let state = rover.sand.as_deref_mut();
        let Some((layer, state)) = rover.terrain.soft().zip(state) else {
            if let Some(sand) = &mut self.sand {
                sand.load(lane, None);
            }
            return;
        };
        let machine = &*self.machine;
        let sand = self.sand.get_or_insert_with(|| {
            let wheels = machine.in_sand.iter().copied();
            Box::new(SandContact::new(self.token, machine, wheels))
        });
        sand.load(lane, Some((layer, state)));
        std::mem::swap(&mut self.ruts[lane], &mut state.ruts);
    }

    /// Gives a rover its sand and its ruts back.
    pub(super) fn store_sand(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        if let (Some(sand), Some(state)) = (&self.sand, rover.sand.as_deref_mut()) {
            sand.store(lane, state);
        }
        self.return_ruts(lane, rover);
    }

    /// Gives a rover that is not stored its ruts back.
    pub(super) fn return_ruts(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        if let Some(state) = rover.sand.as_deref_mut() {
            std::mem::swap(&mut self.ruts[lane], &mut state.ruts);
        }
    }

    /// Most repetitions of a lane's step.
    pub(super) fn most_revisions_of(&self, lane: usize) -> usize {
        let in_sand = (self.sand.as_ref()).is_some_and(|sand| sand.lanes().get(lane));
        if in_sand {
            MOST_REVISIONS_IN_SAND
        } else {
            MOST_REVISIONS
        }
    }

    /// The forces of the sand at the velocity before the step.
    pub(super) fn sink(&mut self, options: &StepOptions, going: T::Mask) {
        if let Some(mut sand) = self.sand.take() {
            let step = (options.time_step, options.theta);
            sand.linearise(&self.sand_scene(), going, step, self.gravity);
            self.sand = Some(sand);
        }
    }

    /// The lanes whose force of the sand is another at the end of the step.
    pub(super) fn revise_sand(&mut self, lanes: T::Mask, v_end: &[T]) -> T::Mask {
        let Some(mut sand) = self.sand.take() else {
            return T::mask(self.token, 0);
        };
        let is_new = sand.revise(&self.sand_scene(), lanes, &self.factor, v_end);
        self.sand = Some(sand);
        is_new
    }

    /// Work of the sand on each cluster over the step, J.
    pub(super) fn weigh_sand(&mut self, velocities: [&[T]; 2]) {
        let mut work = std::mem::take(&mut self.of_sand);
        work.fill(self.number(0.0));
        if let Some(mut sand) = self.sand.take() {
            sand.work(&self.machine, &self.layers(), velocities, &mut work);
            self.sand = Some(sand);
        }
        self.of_sand = work;
    }

    /// Notes where the wheels of the lanes are that are still going.
    pub(super) fn note_ruts(&mut self, going: T::Mask) {
        let Some(mut sand) = self.sand.take() else {
            return;
        };
        let mut ruts = std::mem::take(&mut self.ruts);
        sand.note(&self.layers(), going, &mut ruts);
        (self.sand, self.ruts) = (Some(sand), ruts);
    }

    /// Soft ground of each lane.
    fn layers(&self) -> Layers<'_> {
        let mut layers = [None; MAX_LANES];
        for (lane, layer) in layers.iter_mut().enumerate().take(T::LANES) {
            *layer = self.ground.terrain(lane).and_then(|own| own.soft());
        }
        layers
    }

    fn sand_scene(&self) -> SandScene<'_, T> {
        SandScene {
            mechanism: &self.machine,
            poses: &self.poses_middle,
            layers: self.layers(),
            ruts: &self.ruts,
        }
    }
}

impl<T: Lane> Block<T> {
    /// Gives a rover that is not [stored](Self::store_rover) its ruts back.
    pub fn return_ruts(&mut self, lane: usize, rover: &mut LaneRover<'_>) {
        self.system.return_ruts(lane, rover);
    }

    /// Gives a rover its ruts back if the lane has them, after a panic.
    pub fn recover_ruts(&mut self, lane: usize, ruts: &mut RutMap) {
        // A rover whose ruts are here has a map without wheels in their place.
        let own = self.system.ruts.get_mut(lane);
        if let Some(own) = own.filter(|own| own.n_wheels() > ruts.n_wheels()) {
            std::mem::swap(own, ruts);
        }
    }
}
