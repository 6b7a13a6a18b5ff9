//! One episode: its progress and its last outcome.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::action;
use super::channels::EpisodeMoment;
use super::error::{EpisodeError, check_lengths};
use super::observation::{write_heights, write_state};
use super::outcome::Outcome;
use super::progress::Progress;
use super::quantities::Quantities;
use super::reward::{PeriodReward, squared_changes, terms};
use super::rules::Rules;
use super::setting::EpisodeSetting;
use rover_core::scalar::elementary::hypot;
use rover_core::simulation::{CommandError, ReadingScratch, RoverSimulation, seen_from};

/// A control period seen from its end.
#[derive(Clone, Copy, Debug)]
pub struct Period<'a> {
    /// Action of the period (n_actions).
    pub action: &'a [f64],
    /// Heights of the scan; None where it was not taken.
    pub heights: Option<&'a [f64]>,
    /// A standard normal number for each entry of the observation; None without noise.
    pub normals: Option<&'a [f64]>,
    /// Whether a physics step could not be taken.
    pub has_failed: bool,
}

/// What an episode needs to go on, besides its rules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeState {
    /// What was drawn for it.
    pub setting: EpisodeSetting,
    /// Progress of the episode.
    pub progress: Progress,
    /// The last observation (size).
    pub observation: Vec<f32>,
    /// The outcome of the last period.
    pub outcome: Outcome,
    /// Normal numbers of an observation that lacks its heights, empty without noise.
    pub pending_normals: Option<Vec<f64>>,
}

/// An episode outside its simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    rules: Arc<Rules>,
    setting: EpisodeSetting,
    progress: Progress,
    observation: Vec<f32>,
    outcome: Outcome,
    lacks_heights: bool,
    /// Normal numbers of the last observation, if it lacks heights.
    pending_normals: Vec<f64>,
}

impl Episode {
    /// The beginning of an episode of a rover, or None if its observation is not finite in float32.
    ///
    /// `normals`: see [`Period`].
    ///
    /// # Errors
    /// `Length`, `OutOfRange`: the setting or the normal numbers do not fit, or the rover's model
    /// does not fit the rules.
    pub fn begin(
        rules: Arc<Rules>,
        setting: EpisodeSetting,
        rover: &RoverSimulation,
        normals: Option<&[f64]>,
    ) -> Result<Option<Self>, EpisodeError> {
        setting.check(&rules)?;
        rules.check_model(rover.model())?;
        check_normals(&rules, normals)?;
        let mut scratch = ReadingScratch::default();
        let mut reading = vec![0.0; rules.places().size];
        let mut heights = vec![0.0; rules.settings().scan.len()];
        rover.read_state(setting.goal, &mut scratch, &mut reading);
        rover.read_heights(&rules.settings().scan, &mut heights);
        let now = Quantities::of(&reading[rules.places().scalars.clone()]);
        let progress = Progress::begin([reading[0], reading[2]], now.distance, rules.n_actions());
        let mut observation = vec![0.0; rules.size()];
        let begun = EpisodeMoment {
            settings: rules.settings(),
            reading: &reading,
            next_goal: setting.goal_at(progress.reached + 1),
            progress: &progress,
        };
        let is_finite = write_state(&rules, &begun, normals, &mut observation)
            & write_heights(&rules, &heights, normals, &mut observation);
        Ok(is_finite.then(|| Self {
            rules,
            setting,
            progress,
            observation,
            outcome: Outcome {
                now,
                ..Outcome::default()
            },
            pending_normals: Vec::new(),
            lacks_heights: false,
        }))
    }

    /// State from which [`Self::resume`] continues the episode.
    #[must_use]
    pub fn state(&self) -> EpisodeState {
        EpisodeState {
            setting: self.setting.clone(),
            progress: self.progress.clone(),
            observation: self.observation.clone(),
            outcome: self.outcome,
            pending_normals: self.lacks_heights.then(|| self.pending_normals.clone()),
        }
    }

    /// An episode that goes on from a state.
    ///
    /// # Errors
    /// `Length`, `OutOfRange`: it does not fit the rules, or is not finite.
    pub fn resume(rules: Arc<Rules>, state: EpisodeState) -> Result<Self, EpisodeError> {
        let EpisodeState {
            setting,
            progress,
            observation,
            outcome,
            pending_normals,
        } = state;
        setting.check(&rules)?;
        check_normals(&rules, pending_normals.as_deref().or(Some(rules.noise())))?;
        let (previous, size) = (progress.previous_action.len(), observation.len());
        check_lengths([
            ("previous_action", previous, rules.n_actions()),
            ("observation", size, rules.size()),
        ])?;
        let numbers = [
            ("distance", progress.distance),
            ("energy", progress.energy),
            ("energy_positive", progress.energy_positive),
            ("stuck_time", progress.stuck_time),
            ("start", progress.start[0]),
            ("start", progress.start[1]),
            ("away", progress.away),
            ("outside", progress.outside),
        ];
        let entries = (progress.previous_action.iter()).map(|&a| ("previous_action", a));
        let seen = observation.iter().map(|&x| ("observation", f64::from(x)));
        let results = outcome.now.row().into_iter().chain(outcome.terms);
        // A step that failed has an infinite residual.
        let results = results.filter(|x| x.is_nan()).map(|x| ("outcome", x));
        for (field, value) in numbers
            .into_iter()
            .chain(entries)
            .chain(seen)
            .chain(results)
        {
            if !value.is_finite() {
                return Err(EpisodeError::OutOfRange {
                    field,
                    range: "finite",
                    value,
                });
            }
        }
        Ok(Self {
            rules,
            setting,
            progress,
            observation,
            outcome,
            lacks_heights: pending_normals.is_some(),
            pending_normals: pending_normals.unwrap_or_default(),
        })
    }

    /// The rules.
    #[must_use]
    pub fn rules(&self) -> &Arc<Rules> {
        &self.rules
    }

    /// What was drawn for it.
    #[must_use]
    pub fn setting(&self) -> &EpisodeSetting {
        &self.setting
    }

    /// The present goal (x, z), m; the last one where all are reached.
    #[must_use]
    pub fn goal(&self) -> [f64; 2] {
        self.setting.goal_at(self.progress.reached)
    }

    /// Way to the last goal, straight from goal to goal, m.
    #[must_use]
    pub fn way(&self) -> f64 {
        self.progress.distance + self.setting.way_from(self.progress.reached)
    }

    /// Progress of the episode.
    #[must_use]
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The last observation (size).
    #[must_use]
    pub fn observation(&self) -> &[f32] {
        &self.observation
    }

    /// The outcome of the last period; that of the beginning earns nothing.
    #[must_use]
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Gives a rover the commands of an action (n_actions) that has been checked.
    ///
    /// `commands`: room for them (n_commands).
    ///
    /// # Errors
    /// A command that the rover's model refuses, see [`Rules::check_model`].
    pub fn command(
        &self,
        rover: &mut RoverSimulation,
        action: &[f64],
        commands: &mut [f64],
    ) -> Result<(), CommandError> {
        let (torques, set_points) = commands.split_at_mut(self.rules.n_wheels());
        let gain = self.setting.domain.actuator_gain;
        action::commands(&self.rules, action, gain, torques, set_points);
        rover.set_commands(torques, set_points)
    }

    /// Goes on by a control period and writes its observation (size).
    ///
    /// `reading`: the rover's after the period, without heights; numbers in it that are not finite
    /// are set to zero. A period whose observation float32 cannot hold, or in which a physics step
    /// failed, ends the episode, and the observation is the last one. Without heights the last ones
    /// stay, until [`Self::complete`].
    ///
    /// # Panics
    /// If a slice does not fit the rules.
    pub fn advance(&mut self, reading: &mut [f64], period: &Period<'_>, observation: &mut [f32]) {
        let rules = &*self.rules;
        let heights = period.heights.unwrap_or_default();
        let is_finite = |numbers: &[f64]| numbers.iter().fold(true, |all, x| all & x.is_finite());
        let is_readable = is_finite(reading) & is_finite(heights);
        if !is_readable {
            for x in reading.iter_mut().filter(|x| !x.is_finite()) {
                *x = 0.0;
            }
        }
        let mut now = Quantities::of(&reading[rules.places().scalars.clone()]);
        if !is_readable {
            now.distance = self.progress.distance;
        }
        let mut approach = self.progress.distance - now.distance;
        let changes = squared_changes(
            period.action,
            &self.progress.previous_action,
            rules.n_wheels(),
        );
        let dt = rules.settings().dt;
        (self.progress).advance(period.action, &now, dt, self.setting.trunk_load_limit);

        if is_readable && !period.has_failed {
            let ([x, z], before) = (self.progress.start, self.progress.away);
            self.progress.away = hypot(reading[0] - x, reading[2] - z);
            let place = [reading[0], reading[2]];
            self.progress.outside = self.setting.outside([x, z], place);
            if rules.settings().free_distance.is_some() {
                approach = self.progress.away - before;
            }
            now.distance = reach(rules, &self.setting, &mut self.progress, reading);
        }

        let normals = period.normals;
        let ended = EpisodeMoment {
            settings: rules.settings(),
            reading,
            next_goal: self.setting.goal_at(self.progress.reached + 1),
            progress: &self.progress,
        };
        let mut is_sound = write_state(rules, &ended, normals, observation);
        let n_state = rules.n_state();
        if period.heights.is_some() {
            is_sound &= write_heights(rules, heights, normals, observation);
        } else {
            observation[n_state..].copy_from_slice(&self.observation[n_state..]);
        }
        let has_failed = period.has_failed || !is_readable || !is_sound;
        if has_failed {
            observation.copy_from_slice(&self.observation);
        } else {
            self.observation.copy_from_slice(observation);
            self.lacks_heights = period.heights.is_none();
            if let (true, Some(normals)) = (self.lacks_heights, normals) {
                self.pending_normals.clear();
                self.pending_normals.extend_from_slice(normals);
            }
        }

        let ending = rules.ending(&now, &self.progress, has_failed);
        let earned = PeriodReward {
            now: &now,
            approach,
            changes,
            entries: [rules.n_wheels(), rules.n_steering()],
            dt,
            ending,
        };
        let terms = terms(&rules.settings().weights, &earned);
        self.outcome = Outcome {
            now,
            energy: self.progress.energy,
            energy_positive: self.progress.energy_positive,
            terms,
            reward: terms.iter().fold(0.0, |sum, term| sum + term),
            ending,
        };
    }

    /// Whether the last observation lacks the heights of its place.
    #[must_use]
    pub fn lacks_heights(&self) -> bool {
        self.lacks_heights
    }

    /// Takes the scan that the last observation lacks. The rover must not have moved since.
    ///
    /// Heights that are not finite leave the last ones.
    pub fn complete(&mut self, rover: &RoverSimulation) {
        if !std::mem::take(&mut self.lacks_heights) {
            return;
        }
        let rules = &*self.rules;
        let mut heights = vec![0.0; rules.settings().scan.len()];
        rover.read_heights(&rules.settings().scan, &mut heights);
        let normals = rules.is_noisy().then_some(&self.pending_normals[..]);
        let mut observation = self.observation.clone();
        if write_heights(rules, &heights, normals, &mut observation) {
            self.observation = observation;
        }
    }
}

/// Counts the goals that a rover has reached, aims the reading at the next, and returns its
/// distance, m.
fn reach(
    rules: &Rules,
    setting: &EpisodeSetting,
    progress: &mut Progress,
    reading: &mut [f64],
) -> f64 {
    let settings = rules.settings();
    while progress.reached < settings.goals && progress.distance <= settings.goal_tolerance {
        progress.reached += 1;
        if progress.reached < settings.goals {
            let [x, z, heading] = [reading[0], reading[2], reading[4]];
            let seen = seen_from([x, z], heading, setting.goal_at(progress.reached));
            reading[rules.n_shared() - seen.len()..rules.n_shared()].copy_from_slice(&seen);
            progress.distance = seen[2];
        }
    }
    progress.distance
}

/// Checks the number of the normal numbers, which must be there if and only if there is noise.
///
/// # Errors
/// `Length`.
pub fn check_normals(rules: &Rules, normals: Option<&[f64]>) -> Result<(), EpisodeError> {
    let given = normals.map_or(0, <[f64]>::len);
    check_lengths([("normals", given, rules.noise().len())])
}
