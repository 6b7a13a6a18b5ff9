//! The sand under the wheels in a step: [`crate::system::sand`].

use std::sync::Arc;

use nalgebra::Vector6;

use super::TreeLanes;
use crate::geometry::Terrain;
use crate::integrator::{MOST_REVISIONS, StepOptions};
use crate::sand::{RutMap, SandState};
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::system::sand::{MOST_REVISIONS_IN_SAND, SandContact};
use crate::system::sand_patch::{Layers, SandScene};

impl<T: Lane> TreeLanes<T> {
    /// Takes over the sand of a lane's tree, and its ruts.
    pub fn load_sand(
        &mut self,
        lane: usize,
        terrain: &Arc<dyn Terrain>,
        state: Option<&mut SandState>,
    ) {
        let Some((layer, state)) = terrain.soft().zip(state) else {
            self.soft[lane] = None;
            if let Some(sand) = &mut self.sand {
                sand.load(lane, None);
            }
            return;
        };
        let sand = self.sand.get_or_insert_with(|| {
            let wheels = self.in_sand.iter().copied();
            Box::new(SandContact::new(self.token, &self.mechanism, wheels))
        });
        sand.load(lane, Some((layer, state)));
        self.soft[lane] = Some(Arc::clone(terrain));
        self.swap_ruts(lane, state);
    }

    /// Exchanges the ruts of a lane with those of a tree.
    pub fn swap_ruts(&mut self, lane: usize, state: &mut SandState) {
        std::mem::swap(&mut self.ruts[lane], &mut state.ruts);
    }

    /// Gives a tree its sand and its ruts back.
    pub fn store_sand(&mut self, lane: usize, state: Option<&mut SandState>) {
        let Some(state) = state else {
            return;
        };
        if let Some(sand) = &self.sand {
            sand.store(lane, state);
        }
        self.return_ruts(lane, Some(state));
    }

    /// Gives a tree that is not stored its ruts back.
    pub fn return_ruts(&mut self, lane: usize, state: Option<&mut SandState>) {
        if let Some(state) = state {
            self.swap_ruts(lane, state);
        }
    }

    /// Gives a tree its ruts back if the lane has them, after a panic.
    pub fn recover_ruts(&mut self, lane: usize, ruts: &mut RutMap) {
        // A tree whose ruts are here has a map without wheels in their place.
        let own = self.ruts.get_mut(lane);
        if let Some(own) = own.filter(|own| own.n_wheels() > ruts.n_wheels()) {
            std::mem::swap(own, ruts);
        }
    }

    /// The sand; none before a tree stood on soft ground.
    pub(crate) fn sand(&self) -> Option<&SandContact<T>> {
        self.sand.as_deref()
    }

    /// Gives the next steps of a lane the forces of the sand, see [`SandContact::give`]. Wheels
    /// leave no ruts.
    pub fn give_sand(&mut self, lane: usize, wrenches: Option<&[Option<Vector6<f64>>]>) {
        if let Some(sand) = &mut self.sand {
            sand.ruts_stay = true;
            sand.give(lane, wrenches);
        }
    }

    /// Adds the impulse of the sand over a step that ends with the velocity `v`: only if its forces
    /// are given, or only if not.
    #[inline(always)]
    pub(super) fn push_with_sand(
        &self,
        options: &StepOptions,
        v: &[T],
        out: &mut [T],
        is_given: bool,
    ) {
        if let Some(sand) = &self.sand
            && sand.is_given() == is_given
        {
            sand.add_impulse(options.time_step, v, out);
        }
    }

    /// Takes the forces of the sand as they are, without their tangents, of which those whose sizes
    /// differ too much leave no factor of M̂; whether there is any.
    pub fn drop_tangents(&mut self) -> bool {
        let sand = self.sand.as_mut().filter(|sand| sand.lanes().any());
        sand.is_some_and(|sand| {
            sand.drop_tangents();
            true
        })
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
    pub(super) fn find_sand_work(&mut self, velocities: [&[T]; 2]) {
        let mut work = std::mem::take(&mut self.of_sand);
        work.fill(self.number(0.0));
        if let Some(mut sand) = self.sand.take() {
            sand.work(&self.mechanism, &self.layers(), velocities, &mut work);
            self.sand = Some(sand);
        }
        self.of_sand = work;
    }

    /// Notes where the wheels of the lanes are that are still going.
    pub fn note_ruts(&mut self, going: T::Mask) {
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
            *layer = self.soft[lane].as_ref().and_then(|own| own.soft());
        }
        layers
    }

    pub(crate) fn sand_scene(&self) -> SandScene<'_, T> {
        SandScene {
            mechanism: &self.mechanism,
            poses: &self.poses_middle,
            layers: self.layers(),
            ruts: &self.ruts,
        }
    }
}
