//! The state of an episode outside the simulation.

use super::quantities::Quantities;
use serde::{Deserialize, Serialize};

/// A rover is high-centred while its trunk carries too much of the weight and it is no faster than
/// this, m/s.
pub const STUCK_SPEED: f64 = 0.05;

/// What an episode remembers from period to period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Horizontal distance to the present goal, m.
    pub distance: f64,
    /// The last action (n_actions); zeros at the beginning.
    pub previous_action: Vec<f64>,
    /// Work of the motors since the beginning, driving or braking, J.
    pub energy: f64,
    /// Driving part of the motors' work since the beginning, J.
    pub energy_positive: f64,
    /// How long the rover has been high-centred, s.
    pub stuck_time: f64,
    /// How many goals have been reached.
    pub reached: usize,
    /// Where the episode began, (x, z), m.
    pub start: [f64; 2],
    /// Horizontal distance from there, m.
    pub away: f64,
    /// Distance outside the rectangle of start and goals, the larger of those along x and z, m.
    pub outside: f64,
}

impl Progress {
    /// At the beginning at a place (x, z), at a distance from the goal, m.
    #[must_use]
    pub fn begin(start: [f64; 2], distance: f64, n_actions: usize) -> Self {
        Self {
            distance,
            previous_action: vec![0.0; n_actions],
            energy: 0.0,
            energy_positive: 0.0,
            stuck_time: 0.0,
            reached: 0,
            start,
            away: 0.0,
            outside: 0.0,
        }
    }

    /// Goes on by a control period of `dt` (s). `trunk_load_limit`: force on the trunk beyond which
    /// it is high-centred, N.
    pub fn advance(&mut self, action: &[f64], now: &Quantities, dt: f64, trunk_load_limit: f64) {
        self.distance = now.distance;
        self.previous_action.copy_from_slice(action);
        self.energy += now.work;
        self.energy_positive += now.positive_work;
        let is_stuck = now.trunk_force > trunk_load_limit && now.speed <= STUCK_SPEED;
        self.stuck_time = if is_stuck { self.stuck_time + dt } else { 0.0 };
    }
}
