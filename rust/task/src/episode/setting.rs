//! The setting of an episode: its goals, and the properties of rover and world.

use super::error::{EpisodeError, check_lengths};
use super::rules::Rules;
use crate::draw::Domain;
use rover_core::scalar::elementary::hypot;
use serde::{Deserialize, Serialize};

/// What was drawn for an episode. Only goals, gain and load limit act; the rest is reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeSetting {
    /// The goal (x, z), m; the first of several.
    pub goal: [f64; 2],
    /// Goals that follow it, in order, (x, z), m.
    pub further: Vec<[f64; 2]>,
    /// Properties of rover and world.
    pub domain: Domain,
    /// Force on the trunk beyond which the rover is high-centred, N.
    pub trunk_load_limit: f64,
    /// Difficulty of the rocks; 0 where there are none.
    pub difficulty: f64,
}

impl EpisodeSetting {
    /// The goal of a number, from zero; the last one from there on.
    #[must_use]
    pub fn goal_at(&self, number: usize) -> [f64; 2] {
        match number.min(self.further.len()) {
            0 => self.goal,
            k => self.further[k - 1],
        }
    }

    /// How far a place lies outside the rectangle that the start and all goals span, along x or z,
    /// whichever is more, m; 0 within.
    #[must_use]
    pub fn outside(&self, start: [f64; 2], place: [f64; 2]) -> f64 {
        let beyond = [0, 1].map(|k| {
            let goals = || self.further.iter().map(|goal| goal[k]);
            let low = goals().fold(start[k].min(self.goal[k]), f64::min);
            let high = goals().fold(start[k].max(self.goal[k]), f64::max);
            (low - place[k]).max(place[k] - high)
        });
        beyond[0].max(beyond[1]).max(0.0)
    }

    /// Way from the goal of a number to the last, leg by leg, m.
    #[must_use]
    pub fn way_from(&self, number: usize) -> f64 {
        let legs = (number..self.further.len()).map(|k| {
            let ([a, b], [c, d]) = (self.goal_at(k), self.goal_at(k + 1));
            hypot(c - a, d - b)
        });
        legs.fold(0.0, |sum, leg| sum + leg)
    }

    /// Checks that it fits the rules.
    pub(super) fn check(&self, rules: &Rules) -> Result<(), EpisodeError> {
        check_lengths([("goals", 1 + self.further.len(), rules.settings().goals)])?;
        let Domain {
            mass_scale,
            friction,
            actuator_gain,
            gravity_scale,
        } = self.domain;
        let numbers = [
            ("goal", self.goal[0]),
            ("goal", self.goal[1]),
            ("domain.mass_scale", mass_scale),
            ("domain.friction", friction),
            ("domain.actuator_gain", actuator_gain),
            ("domain.gravity_scale", gravity_scale),
            ("trunk_load_limit", self.trunk_load_limit),
            ("difficulty", self.difficulty),
        ];
        let further = self.further.iter().flatten().map(|&x| ("further", x));
        let mut all = numbers.into_iter().chain(further);
        match all.find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((field, value)) => Err(EpisodeError::OutOfRange {
                field,
                range: "a finite number",
                value,
            }),
        }
    }
}
