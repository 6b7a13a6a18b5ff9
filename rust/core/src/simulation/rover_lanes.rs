//! The steps of a rover with the usual effort: in its own block, and in a lane of another one.

use std::sync::Arc;

use super::active_contact::ActiveContact;
use super::own_block::solve;
use super::rover::{RoverScene, RoverSimulation};
use super::scene::{UsualOutcome, UsualStep};
use crate::contact::slots::machine::SharedMachine;
use crate::integrator::{NoProbe, Obstacle, Phase, Probe, StepError, StepReport, Variant};
use crate::scalar::{Instructions, Lane, Single};
use crate::solver::batch::problem::ContactProblem;
use crate::solver::batch::queue::Queue;
use crate::system::block::lane_rover::LaneRover;
use crate::system::block::{Next, RoverBlock};

impl RoverScene {
    /// Takes a step in the rover's own block.
    pub(super) fn take_usual_step(
        &self,
        step: &mut UsualStep<'_, Self>,
        probe: &mut dyn Probe,
    ) -> UsualOutcome {
        let own = &mut step.parts.own;
        own.set_last(false);
        if step.options.variant != Variant::Linearised {
            return UsualOutcome::None;
        }
        let token = Single::best();
        let block =
            (own.block).get_or_insert_with(|| Box::new(RoverBlock::new(token, &self.machine)));
        let queue = own.queue.get_or_insert_with(|| Box::new(Queue::new(token)));
        let mut lane_rover = LaneRover {
            model: &self.model,
            terrain: &self.terrain,
            options: step.options,
            command: &step.command.actuators,
            configuration: &mut step.state.configuration,
            v: &mut step.state.v,
            time: &mut step.state.time,
            warm_start: step.warm_start,
            drive_work: &mut step.parts.drive_work,
            wheel_torque: &mut step.memory.wheel_torque,
            loop_impulses: step.parts.tree.loop_impulses_mut(),
            sand: step.memory.sand.as_mut(),
        };
        block.load_rover(0, &mut lane_rover);
        block.begin();
        let (problems, gap_problems) = (&mut own.problems, &mut own.gap_problems);
        for all in [&mut *problems, &mut *gap_problems] {
            all.resize_with(block.n_problems(), ContactProblem::default);
        }
        block.prepare(problems, probe);
        if let Some(obstacle) = block.fallback(0) {
            // Its problems may have more contacts than fit.
            block.return_ruts(0, &mut lane_rover);
            return UsualOutcome::Refused(obstacle);
        }
        let solver = &step.options.solver;
        let mut next = Next::Retake;
        while next == Next::Retake {
            if block.needs_queue() {
                solve(queue, problems, solver);
            }
            probe.end(Phase::Solve);
            next = block.conclude(problems, probe);
        }
        let is_deep = next == Next::Project;
        if is_deep {
            gap_problems.clone_from_slice(problems);
            block.set_gaps(gap_problems);
            if block.needs_queue() {
                solve(queue, gap_problems, solver);
            }
        }
        block.finish(is_deep.then_some(&mut gap_problems[..]), probe);
        if let Some(obstacle) = block.fallback(0) {
            block.return_ruts(0, &mut lane_rover);
            return UsualOutcome::Refused(obstacle);
        }
        block.store_rover(0, &mut lane_rover);
        let report = *block.report(0);
        own.set_last(true);
        UsualOutcome::Taken(report)
    }
}

impl RoverSimulation {
    /// Rovers to a register in a batch on this machine; 1 for the Newton variant, whose steps are
    /// taken alone.
    #[must_use]
    pub fn lanes(&self) -> usize {
        match self.options.variant {
            Variant::Linearised => Instructions::of_this_machine().lanes(),
            Variant::Newton => 1,
        }
    }

    /// What rovers in its block have in common; none if its steps are taken alone.
    pub(super) fn machine(&self) -> Option<&Arc<SharedMachine>> {
        (self.options.variant == Variant::Linearised).then_some(&self.scene.machine)
    }

    /// Whether the machine of another rover is its own. An equal one becomes its own.
    pub(super) fn shares(&mut self, other: &Arc<SharedMachine>) -> bool {
        let Some(own) = self.machine() else {
            return false;
        };
        if Arc::ptr_eq(own, other) {
            return true;
        }
        let is_equal = **own == **other;
        if is_equal {
            self.scene.machine = Arc::clone(other);
        }
        is_equal
    }

    /// Takes a lane of a block. [`RoverBlock::begin`] follows.
    pub(super) fn load<T: Lane>(&mut self, block: &mut RoverBlock<T>, lane: usize) {
        block.load_rover(lane, &mut self.lane_rover());
    }

    /// Takes back what the block has made of it.
    pub(super) fn store<T: Lane>(&mut self, block: &mut RoverBlock<T>, lane: usize) {
        block.store_rover(lane, &mut self.lane_rover());
    }

    /// Leaves a block that has made nothing of it since it was loaded.
    pub(super) fn leave<T: Lane>(&mut self, block: &mut RoverBlock<T>, lane: usize) {
        block.return_ruts(lane, &mut self.lane_rover());
    }

    /// Leaves a block in whose step something panicked: whatever it holds of the rover comes back.
    pub(super) fn recover_from<T: Lane>(&mut self, block: &mut RoverBlock<T>, lane: usize) {
        if let Some(sand) = &mut self.memory.sand {
            block.recover_ruts(lane, &mut sand.ruts);
        }
    }

    /// Lists the contacts of its last step in a block.
    pub(super) fn list_from<T: Lane>(&mut self, block: &RoverBlock<T>, lane: usize) {
        self.active.clear();
        let active = &mut self.active;
        block.visit_contacts(lane, |contact, position, impulse, velocity| {
            active.push(ActiveContact {
                contact,
                position,
                impulse,
                velocity,
            });
        });
    }

    /// The step with all effort that follows one that a block has not taken.
    pub(super) fn step_alone(&mut self, obstacle: Obstacle) -> Result<StepReport, StepError> {
        let variant = self.options.variant;
        self.step_past(obstacle, &variant, &mut NoProbe)
    }

    fn lane_rover(&mut self) -> LaneRover<'_> {
        LaneRover {
            model: &self.scene.model,
            terrain: &self.scene.terrain,
            options: &self.options,
            command: &self.command.actuators,
            configuration: &mut self.state.configuration,
            v: &mut self.state.v,
            time: &mut self.state.time,
            warm_start: &mut self.warm_start,
            drive_work: &mut self.parts.drive_work,
            wheel_torque: &mut self.memory.wheel_torque,
            loop_impulses: self.parts.tree.loop_impulses_mut(),
            sand: self.memory.sand.as_mut(),
        }
    }
}
