//! The reward: a sum of terms, each a weight times a quantity of the control period.
//!
//! | term | quantity |
//! |---|---|
//! | `progress` | approach to the goal, or way from where the rover was held, m |
//! | `time` | the period dt, s |
//! | `energy` | work of the wheel motors, driving or braking, J |
//! | `slip` | mean slip ratio of the wheels in contact, times dt |
//! | `tilt` | `1 - cos(tilt)` of the trunk, times dt |
//! | `torque_change` | mean square over the wheels of the change of the torque's action |
//! | `steering_change` | the same over the steering joints, of the steering's |
//! | `success` | 1 in the period that reaches the goal or comes free |
//! | `failure` | 1 in a period that ends in failure |
//!
//! The quantities are bounded, whatever the physics did, by [`MOST_PROGRESS`], [`MOST_WORK`],
//! [`MOST_TIME`] and [`MOST_RATIO`]. Normal driving stays within these bounds even over 10 s.

use super::ending::Ending;
use super::quantities::Quantities;

/// Names of the terms, in the order of their sum.
pub const TERMS: [&str; N_TERMS] = [
    "progress",
    "time",
    "energy",
    "slip",
    "tilt",
    "torque_change",
    "steering_change",
    "success",
    "failure",
];

/// Number of the terms.
pub const N_TERMS: usize = 9;

/// Position of the only term that counts after a failed step.
const FAILURE: usize = 8;

/// Largest progress of a period either way, m.
pub const MOST_PROGRESS: f64 = 30.0;

/// Largest work of a period, J.
pub const MOST_WORK: f64 = 4e5;

/// Longest period that counts, s.
pub const MOST_TIME: f64 = 60.0;

/// Largest slip ratio, and `1 - cos(tilt)` of a rover on its back.
pub const MOST_RATIO: f64 = 2.0;

/// Weights of the terms, in the order of [`TERMS`]; a negative one makes its term a cost.
pub type Weights = [f64; N_TERMS];

/// What a control period earns.
#[derive(Clone, Copy, Debug)]
pub struct PeriodReward<'a> {
    /// The quantities at its end.
    pub now: &'a Quantities,
    /// How much nearer it brought the goal, m.
    pub approach: f64,
    /// Sums of the squared changes of the actions: of the torques, of the steering.
    pub changes: [f64; 2],
    /// Entries of an action that are summed, in the same order.
    pub entries: [usize; 2],
    /// Length of the control period, s.
    pub dt: f64,
    /// How it ended.
    pub ending: Ending,
}

/// The terms of the reward.
#[must_use]
pub fn terms(weights: &Weights, earned: &PeriodReward<'_>) -> [f64; N_TERMS] {
    let now = earned.now;
    let [
        progress,
        time,
        energy,
        slip,
        tilt,
        torque_change,
        steering_change,
        success,
        failure,
    ] = *weights;
    let dt = earned.dt.min(MOST_TIME);
    let mean_change =
        |weight: f64, k: usize| weight * earned.changes[k] / earned.entries[k].max(1) as f64;
    let one_if = |is_so: bool| f64::from(u8::from(is_so));
    let mut terms = [
        progress * within(earned.approach, MOST_PROGRESS),
        time * dt,
        energy * within(now.work, MOST_WORK),
        slip * within(now.slip_ratio, MOST_RATIO) * dt,
        tilt * within(1.0 - now.cos_tilt, MOST_RATIO) * dt,
        mean_change(torque_change, 0),
        mean_change(steering_change, 1),
        success * one_if(earned.ending.is_success()) + 0.0, // no negative zero
        failure * one_if(earned.ending.is_failure()) + 0.0,
    ];
    if earned.ending == Ending::StepFailed {
        terms[..FAILURE].fill(0.0);
    }
    terms
}

/// Clips a quantity to [-most, most].
fn within(quantity: f64, most: f64) -> f64 {
    quantity.clamp(-most, most)
}

/// Sums of the squared changes between two actions (n_actions): of the torques, of the steering.
#[must_use]
pub fn squared_changes(action: &[f64], before: &[f64], n_wheels: usize) -> [f64; 2] {
    let sum = |a: &[f64], b: &[f64]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
        squares.fold(0.0, |sum, square| sum + square)
    };
    let (drive, steer) = action.split_at(n_wheels);
    let (drive_before, steer_before) = before.split_at(n_wheels);
    [sum(drive, drive_before), sum(steer, steer_before)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WEIGHTS: Weights = [1.0, -0.05, -5e-5, -0.1, -0.1, -0.02, -0.02, 10.0, -10.0];

    fn reward(now: &Quantities, dt: f64, ending: Ending) -> [f64; N_TERMS] {
        let earned = PeriodReward {
            now,
            approach: 1e30,
            changes: squared_changes(&[1.0; 12], &[-1.0; 12], 6),
            entries: [6, 6],
            dt,
            ending,
        };
        terms(&WEIGHTS, &earned)
    }

    #[test]
    fn no_period_is_worth_more_than_ninety_whatever_the_physics_did() {
        let wild = Quantities {
            work: 1e30,
            slip_ratio: 1e30,
            cos_tilt: -1e30,
            ..Quantities::default()
        };
        let terms = reward(&wild, 1e9, Ending::RollOver);
        assert!(terms.iter().map(|term| term.abs()).sum::<f64>() < 90.0);
        assert!(terms[0] > 29.0 && terms[2] < -19.0, "the bounds count");
    }

    #[test]
    fn after_a_failed_step_only_failure_counts() {
        let terms = reward(&Quantities::default(), 0.05, Ending::StepFailed);
        assert!(terms[..FAILURE].iter().all(|&term| term == 0.0));
        assert!(terms[FAILURE] < -9.0);
    }
}
