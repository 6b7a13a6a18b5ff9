//! Many rovers side by side, each with its episode.
//!
//! A rover's commands, its steps, its reading and what its episode makes of them are one turn
//! ([`rover_core::simulation::turns`]): no thread waits for another within a control period.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use super::action;
use super::beginning::{Beginning, EpisodeDistribution};
use super::control_period::{BatchedEpisode, ControlPeriod, EpisodeOrigin, PeriodSlot};
use super::error::{EpisodeError, check_lengths};
use super::rules::Rules;
use super::running::Episode;
use crate::draw::{Order, Pcg64};
use rover_core::integrator::StepError;
use rover_core::simulation::{BatchError, Done, ReadingScratch, RoverSimulation, Turn, Workers};

/// A rover of a batch, which others may hold, too: they see it move until its next episode begins,
/// with a rover of its own.
pub type SharedRover = Arc<Mutex<RoverSimulation>>;

/// Rovers with their episodes and the threads that step them.
pub struct EpisodeBatch {
    rules: Arc<Rules>,
    rovers: Vec<SharedRover>,
    errors: Vec<Option<StepError>>,
    workers: Workers,
    scratch: ReadingScratch,
    slots: Vec<Option<BatchedEpisode>>,
    max_steps: Option<u64>,
}

/// Takes steps with the rover of an index.
pub type StepAmong<'a> =
    dyn FnMut(usize, &mut RoverSimulation, usize) -> Result<(), StepError> + 'a;

fn shared(rover: RoverSimulation) -> SharedRover {
    Arc::new(Mutex::new(rover))
}

/// Opens all rovers.
///
/// # Errors
/// `Busy`.
fn open_all(rovers: &[SharedRover]) -> Result<Vec<MutexGuard<'_, RoverSimulation>>, EpisodeError> {
    let open = rovers.iter().map(|rover| match rover.try_lock() {
        Ok(rover) => Ok(rover),
        Err(TryLockError::Poisoned(rover)) => Ok(rover.into_inner()),
        Err(TryLockError::WouldBlock) => Err(EpisodeError::Busy),
    });
    open.collect()
}

/// How the rovers' control periods went: an entry for each rover, and lists of indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BatchOutcome {
    /// Rewards.
    pub rewards: Vec<f64>,
    /// Which episodes have ended.
    pub ended: Vec<bool>,
    /// Which episodes have reached the time limit.
    pub truncated: Vec<bool>,
    /// Rovers whose episode is over, one way or the other.
    pub over: Vec<usize>,
}

impl EpisodeBatch {
    /// A batch of `n` copies of a rover; their episodes have yet to begin.
    ///
    /// `max_steps`: control periods until truncation; `threads`: None for one per core.
    ///
    /// # Errors
    /// As [`Rules::check_model`] and [`Workers::new`].
    pub fn new(
        rules: Arc<Rules>,
        rover: &RoverSimulation,
        n: usize,
        max_steps: Option<u64>,
        threads: Option<usize>,
    ) -> Result<Self, EpisodeError> {
        rules.check_model(rover.model())?;
        Ok(Self {
            rovers: (0..n).map(|_| shared(rover.clone())).collect(),
            errors: vec![None; n],
            workers: Workers::new(n, threads)?,
            scratch: ReadingScratch::default(),
            slots: (0..n).map(|_| None).collect(),
            max_steps,
            rules,
        })
    }

    /// The rules of all episodes.
    #[must_use]
    pub fn rules(&self) -> &Arc<Rules> {
        &self.rules
    }

    /// The rovers.
    #[must_use]
    pub fn rovers(&self) -> &[SharedRover] {
        &self.rovers
    }

    /// Threads that step them.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.workers.count()
    }

    /// Error of the last physics step of each rover.
    #[must_use]
    pub fn errors(&self) -> &[Option<StepError>] {
        &self.errors
    }

    /// Message of the physics step that failed in the last period of a rover, if one did.
    #[must_use]
    pub fn message(&self, index: usize) -> Option<String> {
        let error = self.errors[index].as_ref();
        let slot = self.slots[index].as_ref();
        error
            .map(ToString::to_string)
            .or_else(|| slot?.message.clone())
    }

    /// The episode of a rover.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn episode(&self, index: usize) -> Result<&Episode, EpisodeError> {
        Ok(&self.slot(index)?.episode)
    }

    /// Whether an episode has reached the time limit.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn is_truncated(&self, index: usize) -> Result<bool, EpisodeError> {
        Ok(self.slot(index)?.is_truncated(self.max_steps))
    }

    /// Rovers whose episode has ended or reached the time limit, and whose next has not begun.
    #[must_use]
    pub fn over(&self) -> Vec<usize> {
        let is_over = |slot: &Option<BatchedEpisode>| {
            let slot = slot.as_ref();
            slot.is_some_and(|slot| slot.is_over(self.max_steps))
        };
        let slots = self.slots.iter().enumerate();
        slots
            .filter(|(_, slot)| is_over(slot))
            .map(|(i, _)| i)
            .collect()
    }

    /// Where and on what the episode of a rover has begun.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn origin(&self, index: usize) -> Result<&EpisodeOrigin, EpisodeError> {
        Ok(&self.slot(index)?.origin)
    }

    /// Where the noise of a rover comes from.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn generator(&self, index: usize) -> Result<Pcg64, EpisodeError> {
        Ok(self.slot(index)?.generator)
    }

    /// Sets where the noise of a rover comes from.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn set_generator(&mut self, index: usize, generator: Pcg64) -> Result<(), EpisodeError> {
        self.slot(index)?;
        if let Some(slot) = &mut self.slots[index] {
            slot.generator = generator;
        }
        Ok(())
    }

    fn slot(&self, index: usize) -> Result<&BatchedEpisode, EpisodeError> {
        self.check_index(index)?;
        (self.slots[index].as_ref()).ok_or(EpisodeError::NotBegun { index })
    }

    fn check_index(&self, index: usize) -> Result<(), EpisodeError> {
        let len = self.slots.len();
        if index < len {
            return Ok(());
        }
        Err(BatchError::NoSuchRover { index, len }.into())
    }

    /// The last observation of a rover (size), with the heights that it lacks.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`, `Busy`.
    pub fn complete(&mut self, index: usize) -> Result<&[f32], EpisodeError> {
        self.slot(index)?;
        let open = open_all(&self.rovers[index..=index])?;
        let slot = self.slots[index].as_mut();
        let episode = &mut slot.ok_or(EpisodeError::NotBegun { index })?.episode;
        episode.complete(&open[0]);
        Ok(episode.observation())
    }

    /// Draws episodes on the threads of the batch, see [`EpisodeDistribution::draw`]. No rover
    /// changes.
    ///
    /// # Errors
    /// As [`EpisodeDistribution::draw`]; `Threads`.
    pub fn draw(
        &mut self,
        distribution: &EpisodeDistribution,
        orders: &[Order<'_>],
        attempts: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Beginning>>, EpisodeError> {
        let pool = self.workers.pool()?;
        distribution.draw(orders, attempts, pool, go_on)
    }

    /// Checks that an episode may begin with a rover.
    ///
    /// # Errors
    /// `OtherRules`, `NoSuchRover`, or as [`Rules::check_model`].
    pub fn check(&self, index: usize, beginning: &Beginning) -> Result<(), EpisodeError> {
        self.check_index(index)?;
        if *beginning.episode.rules() != self.rules {
            return Err(EpisodeError::OtherRules);
        }
        self.rules
            .check_model(&beginning.scene.placement.scene.model)
    }

    /// Begins a drawn episode with a rover, from whose generator its noise goes on.
    ///
    /// # Errors
    /// As [`Self::check`]; nothing is changed then.
    pub fn begin(&mut self, index: usize, beginning: Beginning) -> Result<(), EpisodeError> {
        self.check(index, &beginning)?;
        let Beginning {
            scene,
            episode,
            random,
        } = beginning;
        let rover = &mut self.rovers[index];
        let begun = if let Some(own) = Arc::get_mut(rover) {
            let own = own.get_mut().unwrap_or_else(PoisonError::into_inner);
            own.begin(scene.placement)
        } else {
            // Whoever else holds it keeps the rover of the episode before.
            RoverSimulation::placed(scene.placement).map(|begun| *rover = shared(begun))
        };
        begun.map_err(|error| BatchError::Options { index, error })?;
        self.errors[index] = None;
        let origin = EpisodeOrigin {
            start: scene.start,
            rocks: scene.rocks,
            ground: scene.ground,
        };
        self.slots[index] = Some(BatchedEpisode::new(episode, origin, random));
        Ok(())
    }

    /// Puts a rover in the middle of its episode in the place of another.
    ///
    /// `steps`: control periods that it has taken; `random`: where its noise comes from; `message`:
    /// of the physics step that failed, if that has ended the episode.
    ///
    /// # Errors
    /// `OtherRules`, `NoSuchRover`, or as [`Rules::check_model`]; nothing is changed then.
    pub fn resume(
        &mut self,
        index: usize,
        rover: RoverSimulation,
        (episode, steps): (Episode, u64),
        origin: EpisodeOrigin,
        random: Pcg64,
        message: Option<String>,
    ) -> Result<(), EpisodeError> {
        if *episode.rules() != self.rules {
            return Err(EpisodeError::OtherRules);
        }
        self.rules.check_model(rover.model())?;
        self.check_index(index)?;
        self.rovers[index] = shared(rover);
        self.errors[index] = None;
        let mut slot = BatchedEpisode::new(episode, origin, random);
        (slot.steps, slot.message) = (steps, message);
        self.slots[index] = Some(slot);
        Ok(())
    }

    /// Control periods of a rover since its episode began.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn steps(&self, index: usize) -> Result<u64, EpisodeError> {
        Ok(self.slot(index)?.steps)
    }

    /// Gives every rover its action for one control period and writes the observations
    /// (n × size, row-major).
    ///
    /// `actions`: n × n_actions, row-major. `active`: rovers that move; the others keep state and
    /// observation. `has_scan`: whether the heights are taken; without, only episodes that end or
    /// reach the time limit take them, and all others keep the last ones. `go_on`: once it returns
    /// false, each rover stops after a whole step, and its episode goes on as after a whole period.
    ///
    /// # Errors
    /// `Length`, `Action`, `NotBegun`, `Busy`, `Threads`; no rover has moved then.
    ///
    /// # Panics
    /// If `observations` has a wrong length.
    pub fn step_while(
        &mut self,
        actions: &[f64],
        active: Option<&[bool]>,
        has_scan: bool,
        observations: &mut [f32],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<BatchOutcome, EpisodeError> {
        self.take_period(actions, active, has_scan, observations, None, go_on)
    }

    /// Gives every rover its action as [`Self::step_while`] does, one rover after the other, and
    /// lets a function take the steps: for rovers that move together with something else. `step` is
    /// given the index of the rover, the rover, and how many steps to take.
    ///
    /// # Errors
    /// As [`Self::step_while`].
    ///
    /// # Panics
    /// As [`Self::step_while`].
    pub fn step_among(
        &mut self,
        actions: &[f64],
        active: Option<&[bool]>,
        has_scan: bool,
        observations: &mut [f32],
        step: &mut StepAmong<'_>,
    ) -> Result<BatchOutcome, EpisodeError> {
        self.take_period(
            actions,
            active,
            has_scan,
            observations,
            Some(step),
            &mut || true,
        )
    }

    fn take_period(
        &mut self,
        actions: &[f64],
        active: Option<&[bool]>,
        has_scan: bool,
        observations: &mut [f32],
        among: Option<&mut StepAmong<'_>>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<BatchOutcome, EpisodeError> {
        self.check_step(actions, active)?;
        let (n, size) = (self.slots.len(), self.rules.size());
        assert_eq!(observations.len(), n * size, "one row a rover");
        let mut open = open_all(&self.rovers)?;
        let rovers: Vec<_> = open.iter_mut().map(|rover| &mut **rover).collect();
        let rows = observations.chunks_exact_mut(size);
        let actions = actions.chunks_exact(self.rules.n_actions());
        let slots = self.slots.iter_mut().flatten();
        let mut places: Vec<_> = (slots.zip(rows).zip(actions).enumerate())
            .map(|(index, ((slot, row), action))| PeriodSlot {
                is_active: active.is_none_or(|active| active[index]),
                slot,
                row,
                action,
            })
            .collect();
        let turn = ControlPeriod {
            rules: &self.rules,
            has_scan,
            max_steps: self.max_steps,
        };
        let substeps = self.rules.settings().substeps;
        let rovers = rovers.into_iter().zip(&mut self.errors);
        let slots = rovers.zip(&mut places);
        match among {
            None => self.workers.take_turns(slots, substeps, &turn, go_on)?,
            Some(step) => {
                for (index, ((rover, error), place)) in slots.enumerate() {
                    let has_moved = turn.is_moving(place);
                    if has_moved {
                        turn.begin(rover, place);
                        *error = step(index, rover, substeps).err();
                    }
                    let done = Done {
                        has_moved,
                        error: error.as_ref(),
                    };
                    turn.end(rover, done, place, &mut self.scratch);
                }
            }
        }
        drop(open);
        Ok(self.results())
    }

    /// Checks the arguments of a step, and that all episodes have begun.
    fn check_step(&self, actions: &[f64], active: Option<&[bool]>) -> Result<(), EpisodeError> {
        let (n, width) = (self.slots.len(), self.rules.n_actions());
        let flags = active.map_or(n, <[bool]>::len);
        check_lengths([("action", actions.len(), n * width), ("active", flags, n)])?;
        action::check(actions, width, false)?;
        if let Some(index) = self.slots.iter().position(Option::is_none) {
            return Err(EpisodeError::NotBegun { index });
        }
        Ok(())
    }

    /// How the last control periods went.
    fn results(&self) -> BatchOutcome {
        let mut results = BatchOutcome::default();
        for (i, slot) in self.slots.iter().flatten().enumerate() {
            let outcome = slot.episode.outcome();
            let (ended, truncated) = (outcome.ending.is_end(), slot.is_truncated(self.max_steps));
            results.rewards.push(outcome.reward);
            results.ended.push(ended);
            results.truncated.push(truncated);
            if ended || truncated {
                results.over.push(i);
            }
        }
        results
    }
}
