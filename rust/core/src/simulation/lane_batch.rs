//! Rovers that one thread steps together, several to a register.
//!
//! Rovers of one machine with alike options fill the lanes of blocks ([`crate::system::block`]).
//! The contact problems of all blocks wait in one queue; a block goes on to its next step as soon
//! as its own are solved, whatever the others do. A lane whose step takes more than the usual
//! effort is taken alone, and comes back. Every rover moves as it would alone, to the last bit.

use std::sync::Arc;

use super::rover::RoverSimulation;
use crate::caught::caught;
use crate::contact::slots::machine::SharedMachine;
use crate::integrator::{NoProbe, StepError, StepOptions, StepReport};
use crate::scalar::{Instructions, Lane};
use crate::solver::batch::problem::ContactProblem;
use crate::solver::batch::queue::Queue;
use crate::system::block::{Next, RoverBlock, are_alike};

/// Rovers that together cost less alone than as a block, as a fraction of its lanes.
const FEW: f64 = 0.4;

/// A rover of a batch, and the place for the error that ended its last call.
#[derive(Debug)]
pub struct BatchRover<'a> {
    /// The rover.
    pub rover: &'a mut RoverSimulation,
    /// Why its call ended early, if it did.
    pub error: &'a mut Option<StepError>,
}

/// The blocks that a thread steps rovers with. Holds no state between calls.
pub struct LaneBatch {
    blocks: Blocks,
}

/// Blocks of this machine's widest lanes.
enum Blocks {
    Singles,
    #[cfg(target_arch = "x86_64")]
    Fours(Box<Lanes<crate::scalar::Fours>>),
    #[cfg(target_arch = "x86_64")]
    Eights(Box<Lanes<crate::scalar::Eights>>),
}

impl LaneBatch {
    /// For a set of instructions; mostly [`Instructions::of_this_machine`].
    #[must_use]
    pub fn new(instructions: Instructions) -> Self {
        let blocks = match instructions {
            Instructions::Baseline => Blocks::Singles,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => Blocks::Fours(Box::new(Lanes::new(token))),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => Blocks::Eights(Box::new(Lanes::new(token))),
        };
        Self { blocks }
    }

    /// Takes `n` steps with each rover, but lets each stop after a whole one once `go_on`, asked
    /// after each step of a block, returns false. A failed step ends the call of its own rover
    /// only.
    pub fn advance(
        &mut self,
        rovers: &mut [BatchRover<'_>],
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        match &mut self.blocks {
            Blocks::Singles => {
                for entry in rovers {
                    entry.go_alone(n, go_on);
                }
            }
            #[cfg(target_arch = "x86_64")]
            Blocks::Fours(lanes) => lanes.advance(rovers, n, go_on),
            #[cfg(target_arch = "x86_64")]
            Blocks::Eights(lanes) => lanes.advance(rovers, n, go_on),
        }
    }
}

impl BatchRover<'_> {
    fn go_alone(&mut self, n: usize, go_on: &mut dyn FnMut() -> bool) {
        *self.error = self.rover.step_while(n, go_on).err();
    }
}

/// A lane's rover in a call.
#[derive(Clone, Copy, Debug)]
struct Slot {
    /// Index of the rover.
    index: usize,
    report: StepReport,
    /// Report of the steps after which the rover itself has its state.
    kept: StepReport,
    has_failed: bool,
    /// Whether the rover took its last step alone.
    was_alone: bool,
}

struct Lanes<T: Lane> {
    token: T::Token,
    machine: Option<Arc<SharedMachine>>,
    blocks: Vec<RoverBlock<T>>,
    /// How far each block is.
    courses: Vec<Course>,
    queue: Queue<T>,
    problems: Vec<ContactProblem>,
    /// Number of the problems of a block.
    size: usize,
    slots: Vec<Option<Slot>>,
}

/// How far a block is in a call.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Steps that it has not finished.
    left: usize,
    /// Whether the block's problems are those of the position projection.
    projects: bool,
}

impl<T: Lane> Lanes<T> {
    fn new(token: T::Token) -> Self {
        Self {
            token,
            machine: None,
            blocks: Vec::new(),
            courses: Vec::new(),
            queue: Queue::new(token),
            problems: Vec::new(),
            size: 0,
            slots: Vec::new(),
        }
    }

    fn advance(
        &mut self,
        rovers: &mut [BatchRover<'_>],
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        let Ok(n_slots) = caught(|| self.slot(rovers)) else {
            *self = Self::new(self.token);
            for entry in rovers {
                entry.go_alone(n, go_on);
            }
            return;
        };
        let mut taken = self.slots[..n_slots].iter().flatten().peekable();
        for (k, entry) in rovers.iter_mut().enumerate() {
            if taken.next_if(|slot| slot.index == k).is_none() {
                entry.go_alone(n, go_on);
            }
        }
        if n_slots > 0 && caught(|| self.advance_blocks(n_slots, rovers, n, go_on)).is_err() {
            self.part(rovers, n, go_on);
        }
    }

    /// After a panic in the blocks every rover takes the steps that it lacks alone, as it would
    /// have moved; that which panics has the error.
    #[cold]
    fn part(&mut self, rovers: &mut [BatchRover<'_>], n: usize, go_on: &mut dyn FnMut() -> bool) {
        for (place, slot) in self.slots.iter().enumerate() {
            let Some(slot) = slot else {
                continue;
            };
            let BatchRover { rover, error } = &mut rovers[slot.index];
            if let Some(block) = self.blocks.get_mut(place / T::LANES) {
                rover.recover_from(block, place % T::LANES);
            }
            if !slot.has_failed {
                **error = rover.resume(&slot.kept, n, go_on).err();
            }
        }
        *self = Self::new(self.token);
    }

    fn advance_blocks(
        &mut self,
        n_slots: usize,
        rovers: &mut [BatchRover<'_>],
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        let n_blocks = n_slots / T::LANES;
        for (b, block) in self.blocks[..n_blocks].iter_mut().enumerate() {
            for lane in 0..T::LANES {
                match &mut self.slots[b * T::LANES + lane] {
                    Some(slot) => {
                        let rover = &mut *rovers[slot.index].rover;
                        rover.begin_call();
                        rover.load(block, lane);
                    }
                    None => block.clear(lane),
                }
            }
            block.begin();
        }
        self.step(n_blocks, rovers, n, go_on);
        for (b, block) in self.blocks[..n_blocks].iter_mut().enumerate() {
            let slots = self.slots[b * T::LANES..][..T::LANES].iter_mut();
            for (lane, slot) in slots.enumerate() {
                if let Some(slot) = slot.as_mut().filter(|slot| !slot.has_failed) {
                    let rover = &mut *rovers[slot.index].rover;
                    if slot.was_alone {
                        rover.leave(block, lane);
                        rover.list_active();
                    } else {
                        rover.store(block, lane);
                        rover.list_from(block, lane);
                    }
                    slot.kept = slot.report;
                    rover.end_call(slot.report);
                }
            }
        }
    }

    /// Gives the rovers that can share blocks their slots, in order; returns how many slots the
    /// blocks have.
    fn slot(&mut self, rovers: &mut [BatchRover<'_>]) -> usize {
        self.slots.clear();
        let mut machines = rovers.iter().filter_map(|entry| entry.rover.machine());
        let Some(machine) = machines.next().cloned() else {
            return 0;
        };
        let mut leader: Option<StepOptions> = None;
        for (k, entry) in rovers.iter_mut().enumerate() {
            if !entry.rover.shares(&machine) {
                continue;
            }
            let own = entry.rover.options();
            if are_alike(own, leader.get_or_insert_with(|| own.clone())) {
                self.slots.push(Some(Slot {
                    index: k,
                    report: StepReport::default(),
                    kept: StepReport::default(),
                    has_failed: false,
                    was_alone: false,
                }));
            }
        }
        let rest = self.slots.len() % T::LANES;
        if (rest as f64) < FEW * T::LANES as f64 {
            self.slots.truncate(self.slots.len() - rest);
        }
        let n_slots = self.slots.len().next_multiple_of(T::LANES);
        self.slots.resize(n_slots, None);
        let is_own = |own: &Arc<SharedMachine>| Arc::ptr_eq(own, &machine) || **own == *machine;
        if !self.machine.as_ref().is_some_and(is_own) {
            self.machine = None;
            self.blocks.clear();
        }
        let own = self.machine.get_or_insert(machine);
        while self.blocks.len() < n_slots / T::LANES {
            self.blocks.push(RoverBlock::new(self.token, own));
        }
        self.size = T::LANES * own.n_problems();
        let n_problems = n_slots / T::LANES * self.size;
        if self.problems.len() < n_problems {
            self.problems
                .resize_with(n_problems, ContactProblem::default);
        }
        n_slots
    }

    /// `n` steps of every block, or fewer once `go_on` returns false.
    fn step(
        &mut self,
        n_blocks: usize,
        rovers: &mut [BatchRover<'_>],
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        let solver = self.blocks[0].options().solver;
        self.queue.begin(n_blocks, self.size);
        self.courses.clear();
        let start = Course {
            left: n,
            projects: false,
        };
        self.courses.resize(n_blocks, start);
        if n == 0 {
            return;
        }
        for b in 0..n_blocks {
            self.prepare(b);
        }
        let mut goes_on = true;
        while let Some(b) = self.queue.next_group(&mut self.problems, &solver) {
            if self.conclude(b) {
                continue;
            }
            self.settle(b, rovers);
            goes_on = goes_on && go_on();
            self.courses[b].left -= 1;
            if goes_on && self.courses[b].left > 0 {
                self.prepare(b);
            }
        }
    }

    /// First part of a block's step: its problems enter the queue.
    fn prepare(&mut self, b: usize) {
        let block = &mut self.blocks[b];
        let problems = &mut self.problems[b * self.size..][..self.size];
        block.prepare(problems, &mut NoProbe);
        (self.queue).enter(b, &mut self.problems, |problem| {
            block.needs_queue() && block.is_going(RoverBlock::<T>::lane_of(problem))
        });
    }

    /// The rest of a block's step, once its problems have ended. Returns whether others must be
    /// solved before: with the next branch of a motor, or those of the position projection.
    fn conclude(&mut self, b: usize) -> bool {
        let (block, course) = (&mut self.blocks[b], &mut self.courses[b]);
        let problems = &mut self.problems[b * self.size..][..self.size];
        let projects = std::mem::take(&mut course.projects);
        if !projects {
            match block.conclude(problems, &mut NoProbe) {
                Next::Retake => {
                    (self.queue).enter(b, &mut self.problems, |problem| {
                        block.needs_queue() && block.is_retaken(RoverBlock::<T>::lane_of(problem))
                    });
                    return true;
                }
                Next::Project => {
                    block.set_gaps(problems);
                    course.projects = true;
                    let is_asked = block.needs_queue();
                    self.queue.enter(b, &mut self.problems, |_| is_asked);
                    return true;
                }
                Next::Finish => {}
            }
        }
        block.finish(projects.then_some(problems), &mut NoProbe);
        false
    }

    /// Notes the reports of a block's step; rovers whose step takes more effort take it alone.
    fn settle(&mut self, b: usize, rovers: &mut [BatchRover<'_>]) {
        let block = &mut self.blocks[b];
        let slots = &mut self.slots[b * T::LANES..][..T::LANES];
        let mut is_changed = false;
        for (lane, slot) in slots.iter_mut().enumerate() {
            let Some(slot) = slot.as_mut().filter(|slot| !slot.has_failed) else {
                continue;
            };
            let Some(obstacle) = block.fallback(lane) else {
                slot.report.merge(block.report(lane));
                slot.was_alone = false;
                continue;
            };
            let BatchRover { rover, error } = &mut rovers[slot.index];
            if slot.kept.steps == slot.report.steps {
                rover.leave(block, lane);
            } else {
                rover.store(block, lane);
            }
            slot.kept = slot.report;
            match rover.step_alone(obstacle) {
                Ok(report) => {
                    slot.report.merge(&report);
                    slot.was_alone = true;
                    slot.kept = slot.report;
                    rover.load(block, lane);
                }
                Err(why) => {
                    **error = Some(why);
                    slot.has_failed = true;
                    block.clear(lane);
                }
            }
            is_changed = true;
        }
        if is_changed {
            block.begin();
        }
    }
}
