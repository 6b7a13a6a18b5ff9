//! A block of rovers: [`crate::integrator::scheme`] in the lanes of a register, with the usual
//! effort.
//!
//! Most steps of a wheeled rover are alike: a tree of joints, wheels that roll and slip, motors,
//! springs and stops. Rovers of one machine take them together, in the lanes of a scalar
//! ([`crate::scalar`]): one, four or eight. A rover that needs more leaves the block before its
//! state changes, and [`crate::integrator::moreau_jean`] takes its step alone.
//!
//! A step has three parts, between which its contact problems are solved with those of other blocks
//! ([`crate::solver::batch::queue`]):
//!
//! 1. [`RoverBlock::prepare`] — poses, contacts, forces, the friction-contact problem;
//! 2. [`RoverBlock::conclude`] — the new velocity and configuration, energy audit, and where
//!    contacts penetrate, the problem of the position projection; where a motor has left the branch
//!    of its line, the friction-contact problem anew;
//! 3. [`RoverBlock::finish`] — the projected configuration, and what the next step remembers.
//!
//! A lane whose step cannot be taken falls back: its state stays as it was.
//!
//! ```text
//! LaneRover ──► RoverBlock::load_rover   state, command and memory of one rover into its lane
//!                    │
//!                    ▼
//!               RoverBlock::prepare      poses, contacts, mass matrix, W, free velocity
//!                    │
//!                    ▼
//!               Queue                    the friction-contact problems
//!                    │
//!                    ▼
//!               RoverBlock::conclude     new state, motors' branches, energy audit
//!                    │  Next             again, or the problem of the position projection
//!                    ▼
//!               RoverBlock::finish ──► RoverBlock::store_rover
//! ```
//!
//! [`lane_rover`]: what a block reads of a rover; `loading`: rovers come and go; `system`: the
//! rovers and their contacts ([`crate::contact::slots`]), as the scheme sees them, with
//! `contact_list`, `problems` and `by_method`. What moves is `crate::system::tree_lanes`.

mod by_method;
mod contact_list;
pub mod lane_rover;
mod loading;
mod problems;
mod system;

use std::sync::Arc;

use self::system::LaneSystem;
use crate::contact::ContactKey;
use crate::contact::slots::machine::SharedMachine;
use crate::integrator::data::Data;
use crate::integrator::projection::set_gaps;
use crate::integrator::{Obstacle, Probe, StepOptions, StepReport, scheme};
use crate::multibody::LaneConfiguration;
use crate::scalar::{Lane, LaneMask};
use crate::solver::Method;
use crate::solver::batch::problem::{ContactProblem, Triple};

pub use crate::integrator::scheme::Next;

/// Whether two rovers may share a block: gravity and friction may differ.
#[must_use]
pub fn are_alike(a: &StepOptions, b: &StepOptions) -> bool {
    let own = StepOptions {
        gravity: a.gravity,
        friction_coefficient: a.friction_coefficient,
        ..b.clone()
    };
    *a == own
}

/// Rovers in the lanes of a register, one fast step at a time.
pub struct RoverBlock<T: Lane> {
    system: LaneSystem<T>,
    data: Data<T, LaneConfiguration<T>, Triple<T>, ContactKey>,
}

impl<T: Lane> RoverBlock<T> {
    /// Lanes without rovers.
    #[must_use]
    pub fn new(token: T::Token, machine: &Arc<SharedMachine>) -> Self {
        let system = LaneSystem::new(token, machine);
        let place = LaneConfiguration::new(token, machine);
        let mut data = Data::new(token, &place, &system.tree);
        data.fit_places(system.contacts.n_slots(), machine.yields());
        Self { system, data }
    }

    /// Options of the rovers; gravity and friction are those of the last that was loaded.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.data.options
    }

    /// Why a lane's last step was not taken, if it was not.
    #[must_use]
    pub fn fallback(&self, lane: usize) -> Option<Obstacle> {
        self.data.obstacles[lane]
    }

    /// Whether a lane takes part in the present step.
    #[must_use]
    pub fn is_going(&self, lane: usize) -> bool {
        self.data.going.get(lane)
    }

    /// Whether a lane's problem must be solved anew, see [`Next::Retake`].
    #[must_use]
    pub fn is_retaken(&self, lane: usize) -> bool {
        (self.data.retaken & self.data.going).get(lane)
    }

    /// Report of a lane's last step.
    #[must_use]
    pub fn report(&self, lane: usize) -> &StepReport {
        &self.data.reports[lane]
    }

    /// World position of a root in a lane where the contacts of the last step were evaluated, m.
    #[must_use]
    pub fn origin(&self, lane: usize, tree: usize) -> [f64; 3] {
        self.system.tree.poses_end.origin_of(tree).get(lane)
    }

    /// Number of the friction-contact problems of all lanes: one of each cluster in each lane.
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.system.contacts.n_problems()
    }

    /// The lane of a problem.
    #[must_use]
    pub fn lane_of(problem: usize) -> usize {
        problem % T::LANES
    }

    /// Whether a queue solves the problems; otherwise the block does.
    #[must_use]
    pub fn needs_queue(&self) -> bool {
        self.data.options.solver.method == Method::Auto
    }

    /// First part of a step: everything up to the friction-contact problems, which it writes.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn prepare(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) {
        scheme::prepare(&mut self.system, &mut self.data, problems, probe);
    }

    /// Second part of a step: the new velocity and configuration, and their energy.
    ///
    /// `problems`: those of [`Self::prepare`], solved.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn conclude(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) -> Next {
        scheme::conclude(&mut self.system, &mut self.data, problems, probe)
    }

    /// Turns the problems into those of the position projection; none where nothing penetrates.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn set_gaps(&mut self, problems: &mut [ContactProblem]) {
        set_gaps(&mut self.system, &mut self.data, problems);
    }

    /// Last part of a step. `problems`: those of [`Self::set_gaps`], solved, if a lane's position
    /// must be projected.
    ///
    /// # Panics
    /// If there are fewer than [`Self::n_problems`].
    pub fn finish(&mut self, problems: Option<&mut [ContactProblem]>, probe: &mut dyn Probe) {
        scheme::finish(&mut self.system, &mut self.data, problems, probe);
        self.system
            .find_loop_impulses(self.data.going, &self.data.p);
        self.system.tree.note_ruts(self.data.going);
    }
}
