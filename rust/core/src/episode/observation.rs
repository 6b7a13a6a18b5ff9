//! The observation: a row of float32 numbers,
//!
//! ```text
//! entry = (float32) (value / scale + σ z)
//! ```
//!
//! | values | size |
//! |---|---|
//! | a reading from `pose` to `target` ([`crate::simulation::ReadingLayout`]) | nq + nv + 5 n + 6 |
//! | the previous action | 2 n |
//! | fraction of the time to high-centring | 1 |
//! | heights of the scan | points |
//!
//! with n wheels. Entries are never clipped.

use super::progress::Progress;
use super::rules::Rules;

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
    progress: &Progress,
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    let stuck = (progress.stuck_time / rules.settings().stuck_time).min(1.0);
    let values = reading[..rules.n_shared()].iter();
    let values = values.chain(&progress.previous_action).chain([&stuck]);
    write(rules, 0, values, normals, out)
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
    write(rules, rules.n_state(), heights.iter(), normals, out)
}

/// Writes values from entry `start` on.
#[allow(clippy::cast_possible_truncation)] // float32 is what an agent gets
fn write<'a>(
    rules: &Rules,
    start: usize,
    values: impl Iterator<Item = &'a f64>,
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    let mut is_finite = true;
    let entries = out[start..].iter_mut().zip(&rules.inverse_scale()[start..]);
    match normals {
        None => {
            for ((entry, inverse), value) in entries.zip(values) {
                *entry = (value * inverse) as f32;
                is_finite &= entry.is_finite();
            }
        }
        Some(normals) => {
            let noise = normals[start..].iter().zip(&rules.noise()[start..]);
            for (((entry, inverse), value), (z, deviation)) in entries.zip(values).zip(noise) {
                *entry = (value * inverse + z * deviation) as f32;
                is_finite &= entry.is_finite();
            }
        }
    }
    is_finite
}
