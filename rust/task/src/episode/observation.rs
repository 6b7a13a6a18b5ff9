//! The observation: a row of float32 numbers,
//!
//! ```text
//! entry = (float32) (value / scale + σ z)
//! ```
//!
//! whose fields [`super::channels::CHANNELS`] declares, in order: spaces, layout and card follow
//! from that table. Entries are never clipped.

use super::progress::Progress;
use super::rules::Rules;
use super::setting::EpisodeSetting;
use rover_core::simulation::seen_from;

/// Most entries between the previous action and the heights.
const MOST_MARKS: usize = 5;

/// Writes the entries before the heights and says whether all of them are finite.
///
/// `reading`: one without heights; `normals`: a standard normal number for each entry, where there
/// is noise.
///
/// # Panics
/// If a slice is too short.
pub fn write_state(
    rules: &Rules,
    reading: &[f64],
    (setting, progress): (&EpisodeSetting, &Progress),
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    let settings = rules.settings();
    let mut marks = [0.0; MOST_MARKS];
    marks[0] = (progress.stuck_time / settings.stuck_time).min(1.0);
    let mut n = 1;
    if let Some(battery) = settings.battery {
        marks[n] = (1.0 - progress.energy / battery).max(0.0);
        n += 1;
    }
    if settings.has_course() {
        let [x, z, heading] = [reading[0], reading[2], reading[4]];
        let [ahead, right, _] = seen_from([x, z], heading, setting.goal_at(progress.reached + 1));
        let remaining = settings.goals.saturating_sub(progress.reached) as f64;
        marks[n..][..3].copy_from_slice(&[ahead, right, remaining]);
        n += 3;
    }
    let (shared, actions) = (rules.n_shared(), rules.n_actions());
    write(rules, 0, &reading[..shared], normals, out)
        & write(rules, shared, &progress.previous_action, normals, out)
        & write(rules, shared + actions, &marks[..n], normals, out)
}

/// Writes the entries of the heights and says whether all of them are finite; slices as for
/// [`write_state`].
///
/// # Panics
/// If a slice is too short.
pub fn write_heights(
    rules: &Rules,
    heights: &[f64],
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    write(rules, rules.n_state(), heights, normals, out)
}

/// Writes values from entry `start` on.
#[allow(clippy::cast_possible_truncation)] // float32 is what an agent gets
fn write(
    rules: &Rules,
    start: usize,
    values: &[f64],
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    let place = start..start + values.len();
    let out = &mut out[place.clone()];
    let entries = out.iter_mut().zip(&rules.inverse_scale()[place.clone()]);
    let entries = entries.zip(values);
    if let Some(normals) = normals {
        let noise = normals[place.clone()].iter().zip(&rules.noise()[place]);
        for (((entry, inverse), value), (z, deviation)) in entries.zip(noise) {
            *entry = (value * inverse + z * deviation) as f32;
        }
    } else {
        for ((entry, inverse), value) in entries {
            *entry = (value * inverse) as f32;
        }
    }
    // A fold without a branch, since all entries but few are finite.
    out.iter().fold(true, |all, entry| all & entry.is_finite())
}
