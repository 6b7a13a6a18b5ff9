//! The settings of a task, with their ranges.

use super::error::EpisodeError;
use super::reward::Weights;

/// The settings of a task. SI units, radians.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Physics steps of a control period.
    pub substeps: usize,
    /// Control period, s.
    pub dt: f64,
    /// Torque of a torque action of 1, (n_wheels), N m.
    pub torque_limits: Vec<f64>,
    /// Set-point of a steering action of 1, rad; 0 if actions do not steer.
    pub max_steering: f64,
    /// Distance within which the goal is reached, m.
    pub goal_tolerance: f64,
    /// Cosine of the tilt beyond which the rover has rolled over.
    pub cos_max_tilt: f64,
    /// Time until a high-centred rover ends the episode, s.
    pub stuck_time: f64,
    /// Weights of the reward's terms, in the order of [`super::TERMS`].
    pub weights: Weights,
    /// Magnitude of gravity, m/s²: observed forces are divided by the mean weight on a wheel.
    pub gravity: f64,
    /// Standard deviation of the noise of entries without bounds; 0 without noise.
    pub noise: f64,
    /// Points of the height scan, as of [`rover_core::simulation::ReadingRequest`].
    pub scan: Vec<[f64; 2]>,
    /// Goals that an episode reaches one after the other, at least one.
    pub goals: usize,
    /// Work of the motors, driving or braking, after which the battery is empty, J; None without
    /// one.
    pub battery: Option<f64>,
    /// Distance from where an episode began at which the rover is free: the episode ends, and
    /// progress is measured from there; None where it is not held.
    pub free_distance: Option<f64>,
    /// How far the field reaches beyond the rectangle of start and goals, m; None without an edge.
    pub field_margin: Option<f64>,
}

impl Settings {
    /// Whether every number is within its range; `is_free`: for a machine on a free base.
    pub(super) fn check(&self, is_free: bool) -> Result<(), EpisodeError> {
        let positive = |field, value: f64| (field, value, value > 0.0, "a finite number above 0");
        let not_negative =
            |field, value: f64| (field, value, value >= 0.0, "a finite number from 0");
        let any = |field, value: f64| (field, value, true, "a finite number");
        let numbers = [
            positive("dt", self.dt),
            positive("battery", self.battery.unwrap_or(1.0)),
            positive("free_distance", self.free_distance.unwrap_or(1.0)),
            positive("field_margin", self.field_margin.unwrap_or(1.0)),
            (
                "goals",
                self.goals as f64,
                self.goals == 1 || self.has_course() && is_free,
                "at least 1, and 1 for a machine on a fixed base",
            ),
            positive("gravity", self.gravity),
            not_negative("noise", self.noise),
            not_negative("max_steering", self.max_steering),
            not_negative("goal_tolerance", self.goal_tolerance),
            any("cos_max_tilt", self.cos_max_tilt),
            positive("stuck_time", self.stuck_time),
        ];
        let lists = (self.torque_limits.iter())
            .map(|&x| not_negative("torque_limits", x))
            .chain(self.weights.iter().map(|&x| any("weights", x)))
            .chain(self.scan.iter().flatten().map(|&x| any("scan", x)));
        for (field, value, is_within, range) in numbers.into_iter().chain(lists) {
            if !(is_within && value.is_finite()) {
                return Err(EpisodeError::OutOfRange {
                    field,
                    range,
                    value,
                });
            }
        }
        Ok(())
    }

    /// Whether there is more than one goal.
    #[must_use]
    pub fn has_course(&self) -> bool {
        self.goals > 1
    }
}
