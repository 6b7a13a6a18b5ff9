//! Many rovers side by side, each with its episode.
//!
//! A rover's commands, its steps, its reading and what its episode makes of them are one turn
//! ([`crate::simulation::turns`]): no thread waits for another within a control period.

use std::sync::Arc;

use super::action;
use super::beginning::{Beginning, EpisodeDistribution};
use super::error::EpisodeError;
use super::noise;
use super::rules::Rules;
use super::running::{Episode, Period};
use crate::draw::{Order, Pcg64};
use crate::integrator::StepError;
use crate::simulation::{Batch, BatchError, Done, ReadingScratch, RoverSimulation, Turn};

/// Rovers with their episodes and the threads that step them.
pub struct EpisodeBatch {
    rules: Arc<Rules>,
    batch: Batch,
    seats: Vec<Option<Seat>>,
    max_steps: Option<u64>,
}

/// A rover's episode, and what a batch keeps beside it.
struct Seat {
    episode: Episode,
    /// Control periods since the episode began.
    steps: u64,
    /// Where its noise comes from.
    generator: Pcg64,
    /// Room for the commands of an action.
    commands: Vec<f64>,
}

impl Seat {
    fn new(episode: Episode, generator: Pcg64) -> Self {
        Self {
            commands: vec![0.0; episode.rules().n_commands()],
            episode,
            steps: 0,
            generator,
        }
    }
}

impl EpisodeBatch {
    /// A batch of `n` copies of a rover; their episodes have yet to begin.
    ///
    /// `max_steps`: control periods until truncation; `threads`: None for one per core.
    ///
    /// # Errors
    /// As [`Rules::check_model`] and [`Batch::new`].
    pub fn new(
        rules: Arc<Rules>,
        rover: &RoverSimulation,
        n: usize,
        max_steps: Option<u64>,
        threads: Option<usize>,
    ) -> Result<Self, EpisodeError> {
        rules.check_model(rover.model())?;
        Ok(Self {
            batch: Batch::new(vec![rover.clone(); n], Vec::new(), threads)?,
            seats: (0..n).map(|_| None).collect(),
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
    pub fn rovers(&self) -> &[RoverSimulation] {
        self.batch.rovers()
    }

    /// Threads that step them.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.batch.threads()
    }

    /// Error of the last physics step of each rover.
    #[must_use]
    pub fn errors(&self) -> &[Option<StepError>] {
        self.batch.errors()
    }

    /// The episode of a rover.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn episode(&self, index: usize) -> Result<&Episode, EpisodeError> {
        Ok(&self.seat(index)?.episode)
    }

    /// Whether an episode has reached the time limit.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn is_truncated(&self, index: usize) -> Result<bool, EpisodeError> {
        Ok(is_over(self.seat(index)?.steps, self.max_steps))
    }

    /// Where the noise of a rover comes from.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn generator(&self, index: usize) -> Result<Pcg64, EpisodeError> {
        Ok(self.seat(index)?.generator)
    }

    /// Sets where the noise of a rover comes from.
    ///
    /// # Errors
    /// `NoSuchRover`, `NotBegun`.
    pub fn set_generator(&mut self, index: usize, generator: Pcg64) -> Result<(), EpisodeError> {
        self.seat(index)?;
        if let Some(seat) = &mut self.seats[index] {
            seat.generator = generator;
        }
        Ok(())
    }

    fn seat(&self, index: usize) -> Result<&Seat, EpisodeError> {
        let len = self.seats.len();
        let seat = self.seats.get(index);
        let seat = seat.ok_or(BatchError::NoSuchRover { index, len })?;
        seat.as_ref().ok_or(EpisodeError::NotBegun { index })
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
        let pool = self.batch.pool()?;
        distribution.draw(orders, attempts, pool, go_on)
    }

    /// Checks that an episode may begin with a rover.
    ///
    /// # Errors
    /// `OtherRules`, `NoSuchRover`, or as [`Rules::check_model`].
    pub fn check(&self, index: usize, beginning: &Beginning) -> Result<(), EpisodeError> {
        let len = self.seats.len();
        if index >= len {
            return Err(BatchError::NoSuchRover { index, len }.into());
        }
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
        self.batch.begin(index, scene.placement, scene.start.goal)?;
        self.seats[index] = Some(Seat::new(episode, random));
        Ok(())
    }

    /// Gives every rover its action for one control period and writes the observations
    /// (n × size, row-major).
    ///
    /// `actions`: n × n_actions, row-major. `active`: rovers that move; the others keep state and
    /// observation. `has_scan`: whether the heights are taken; without, only episodes that end or
    /// reach the time limit take them, and all others keep the last ones. `go_on`: as for
    /// [`Batch::step_while`]; an episode whose rover was stopped goes on as after a whole period.
    ///
    /// # Errors
    /// `Length`, `Action`, `NotBegun`, `Threads`; no rover has moved then.
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
    ) -> Result<(), EpisodeError> {
        let (n, width) = (self.seats.len(), self.rules.n_actions());
        let flags = active.map_or(n, <[bool]>::len);
        for (field, actual, expected) in
            [("action", actions.len(), n * width), ("active", flags, n)]
        {
            if actual != expected {
                return Err(EpisodeError::Length {
                    field,
                    expected,
                    actual,
                });
            }
        }
        action::check(actions, width, false)?;
        if let Some(index) = self.seats.iter().position(Option::is_none) {
            return Err(EpisodeError::NotBegun { index });
        }
        let size = self.rules.size();
        assert_eq!(observations.len(), n * size, "one row a rover");
        let rows = observations.chunks_exact_mut(size);
        let actions = actions.chunks_exact(width);
        let seats = self.seats.iter_mut().flatten();
        let mut places: Vec<_> = (seats.zip(rows).zip(actions).enumerate())
            .map(|(index, ((seat, row), action))| Place {
                is_active: active.is_none_or(|active| active[index]),
                seat,
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
        Ok(self.batch.take_turns(&mut places, substeps, &turn, go_on)?)
    }
}

fn is_over(steps: u64, max_steps: Option<u64>) -> bool {
    max_steps.is_some_and(|most| steps >= most)
}

/// A rover's part of a control period.
struct Place<'a> {
    is_active: bool,
    seat: &'a mut Seat,
    action: &'a [f64],
    row: &'a mut [f32],
}

/// The turn of a rover: action, steps, reading, outcome.
struct ControlPeriod<'a> {
    rules: &'a Rules,
    has_scan: bool,
    max_steps: Option<u64>,
}

impl Turn<Place<'_>> for ControlPeriod<'_> {
    fn is_moving(&self, place: &Place<'_>) -> bool {
        place.is_active
    }

    fn begin(&self, rover: &mut RoverSimulation, place: &mut Place<'_>) {
        let seat = &mut *place.seat;
        let given = (seat.episode).command(rover, place.action, &mut seat.commands);
        assert!(
            given.is_ok(),
            "invariant: commands of a checked action are within the model's limits"
        );
    }

    fn end(
        &self,
        rover: &RoverSimulation,
        done: Done<'_>,
        place: &mut Place<'_>,
        scratch: &mut ReadingScratch,
    ) {
        let seat = &mut *place.seat;
        if !done.has_moved {
            place.row.copy_from_slice(seat.episode.observation());
            return;
        }
        let rules = self.rules;
        let scan = &rules.settings().scan;
        let mut numbers = std::mem::take(&mut scratch.numbers);
        numbers.resize(rules.places().size + scan.len() + rules.noise().len(), 0.0);
        let (reading, rest) = numbers.split_at_mut(rules.places().size);
        let (heights, normals) = rest.split_at_mut(scan.len());
        rover.read_state(seat.episode.setting().goal, scratch, reading);
        if self.has_scan {
            rover.read_heights(scan, heights);
        }
        noise::draw(&mut seat.generator, normals);
        let period = Period {
            action: place.action,
            heights: self.has_scan.then_some(&*heights),
            normals: rules.is_noisy().then_some(&*normals),
            has_failed: done.error.is_some(),
        };
        seat.episode.advance(reading, &period, place.row);
        seat.steps += 1;
        let ends = seat.episode.outcome().ending.is_end() || is_over(seat.steps, self.max_steps);
        if ends && seat.episode.lacks_heights() {
            seat.episode.complete(rover);
            place.row.copy_from_slice(seat.episode.observation());
        }
        scratch.numbers = numbers;
    }
}
