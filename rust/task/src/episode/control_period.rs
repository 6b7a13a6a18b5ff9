//! The control period of a rover in a batch: action, steps, reading, outcome.

use super::noise;
use super::rules::Rules;
use super::running::{Episode, Period};
use crate::draw::{DrawnGround, Pcg64, RockDraw, Start};
use rover_core::simulation::{Done, ReadingScratch, RoverSimulation, Turn};

/// A rover's episode, and what a batch keeps beside it.
pub(super) struct BatchedEpisode {
    pub(super) episode: Episode,
    /// Where and on what it began.
    pub(super) origin: EpisodeOrigin,
    /// Control periods since the episode began.
    pub(super) steps: u64,
    /// Generator of the observation noise.
    pub(super) generator: Pcg64,
    /// Message of the physics step that failed before the episode was resumed.
    pub(super) message: Option<String>,
    /// Room for the commands of an action.
    commands: Vec<f64>,
}

/// Where and on what an episode has begun.
#[derive(Clone, Debug)]
pub struct EpisodeOrigin {
    /// Slope, pose and goal.
    pub start: Start,
    /// Difficulty and rocks, where there are any.
    pub rocks: Option<RockDraw>,
    /// The ground.
    pub ground: DrawnGround,
}

impl BatchedEpisode {
    pub(super) fn new(episode: Episode, origin: EpisodeOrigin, generator: Pcg64) -> Self {
        Self {
            commands: vec![0.0; episode.rules().n_commands()],
            episode,
            origin,
            steps: 0,
            generator,
            message: None,
        }
    }

    /// Whether the episode has reached a time limit.
    pub(super) fn is_truncated(&self, max_steps: Option<u64>) -> bool {
        max_steps.is_some_and(|most| self.steps >= most)
    }

    /// Whether the episode has ended or reached a time limit.
    pub(super) fn is_over(&self, max_steps: Option<u64>) -> bool {
        self.episode.outcome().ending.is_end() || self.is_truncated(max_steps)
    }
}

/// A rover's part of a control period.
pub(super) struct PeriodSlot<'a> {
    pub(super) is_active: bool,
    pub(super) slot: &'a mut BatchedEpisode,
    pub(super) action: &'a [f64],
    pub(super) row: &'a mut [f32],
}

/// The turn of a rover: action, steps, reading, outcome.
pub(super) struct ControlPeriod<'a> {
    pub(super) rules: &'a Rules,
    pub(super) has_scan: bool,
    pub(super) max_steps: Option<u64>,
}

impl Turn<PeriodSlot<'_>> for ControlPeriod<'_> {
    fn is_moving(&self, place: &PeriodSlot<'_>) -> bool {
        place.is_active
    }

    fn begin(&self, rover: &mut RoverSimulation, place: &mut PeriodSlot<'_>) {
        let slot = &mut *place.slot;
        let given = (slot.episode).command(rover, place.action, &mut slot.commands);
        assert!(
            given.is_ok(),
            "invariant: commands of a checked action are within the model's limits"
        );
    }

    fn end(
        &self,
        rover: &RoverSimulation,
        done: Done<'_>,
        place: &mut PeriodSlot<'_>,
        scratch: &mut ReadingScratch,
    ) {
        let slot = &mut *place.slot;
        if !done.has_moved {
            place.row.copy_from_slice(slot.episode.observation());
            return;
        }
        let rules = self.rules;
        let scan = &rules.settings().scan;
        let mut numbers = std::mem::take(&mut scratch.numbers);
        numbers.resize(rules.places().size + scan.len() + rules.noise().len(), 0.0);
        let (reading, rest) = numbers.split_at_mut(rules.places().size);
        let (heights, normals) = rest.split_at_mut(scan.len());
        rover.read_state(slot.episode.goal(), scratch, reading);
        if self.has_scan {
            rover.read_heights(scan, heights);
        }
        noise::draw(&mut slot.generator, normals);
        let period = Period {
            action: place.action,
            heights: self.has_scan.then_some(&*heights),
            normals: rules.is_noisy().then_some(&*normals),
            has_failed: done.error.is_some(),
        };
        slot.episode.advance(reading, &period, place.row);
        slot.steps += 1;
        if slot.episode.lacks_heights() && slot.is_over(self.max_steps) {
            slot.episode.complete(rover);
            place.row.copy_from_slice(slot.episode.observation());
        }
        scratch.numbers = numbers;
    }
}
