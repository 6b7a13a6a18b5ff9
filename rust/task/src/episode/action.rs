//! From an action to the commands of the wheels.
//!
//! An action is one number in [-1, 1] for the torque of each of the n wheels, then one for each
//! steering joint, in the order of the wheels:
//!
//! ```text
//! torque_i    = a_i · torque_limit_i · gain        N m
//! set_point_i = a_(n + k) · max_steering           rad, k the joint that steers wheel i
//! ```

use super::error::EpisodeError;
use super::rules::Rules;

/// Checks actions, `width` entries each.
///
/// # Errors
/// `Action`: the first entry outside [-1, 1] or not a number. Its place names the rover, unless
/// there `is_single` one.
pub fn check(actions: &[f64], width: usize, is_single: bool) -> Result<(), EpisodeError> {
    // A fold without a branch, as refusals are rare; a NaN is no number within the bounds.
    let is_within = |a: &f64| a.abs() <= 1.0;
    if actions.iter().fold(true, |all, a| all & is_within(a)) {
        return Ok(());
    }
    let found = actions.iter().enumerate().find(|(_, a)| !is_within(a));
    found.map_or(Ok(()), |(k, &value)| {
        let place = if is_single {
            format!("[{k}]")
        } else {
            format!("[{}, {}]", k / width, k % width)
        };
        Err(EpisodeError::Action { place, value })
    })
}

/// Writes the torques (N m) and the steering set-points (rad) of an action (n_actions), each
/// (n_wheels); the set-points of wheels that it does not steer are 0.
///
/// `gain`: torque given over torque asked.
///
/// # Panics
/// If a slice has a wrong length.
pub fn commands(
    rules: &Rules,
    action: &[f64],
    gain: f64,
    torques: &mut [f64],
    set_points: &mut [f64],
) {
    let (drive, steer) = action.split_at(rules.n_wheels());
    for ((own, a), limit) in torques
        .iter_mut()
        .zip(drive)
        .zip(&rules.settings().torque_limits)
    {
        *own = a * limit * gain;
    }
    for (own, entry) in set_points.iter_mut().zip(rules.steering_entries()) {
        *own = entry.map_or(0.0, |k| steer[k] * rules.settings().max_steering);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_beyond_one_are_refused_by_their_place() {
        assert!(check(&[1.0, -1.0, 0.5], 3, true).is_ok());
        for value in [1.5, f64::NAN, f64::NEG_INFINITY] {
            let refused = |is_single| check(&[0.0, 0.1, 0.2, value], 2, is_single).unwrap_err();
            assert!(refused(true).to_string().starts_with("action[3]:"));
            assert!(refused(false).to_string().starts_with("action[1, 1]:"));
        }
    }
}
