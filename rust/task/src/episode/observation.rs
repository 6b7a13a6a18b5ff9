//! The observation: a row of float32 numbers,
//!
//! ```text
//! entry = (float32) (value / scale + σ z)
//! ```
//!
//! whose fields [`super::channels::CHANNELS`] declares, in order: spaces, layout and card follow
//! from that table. Entries are never clipped.

use super::channels::{ChannelValue, EpisodeMoment};
use super::rules::Rules;

/// Writes the entries before the heights and says whether all of them are finite.
///
/// `normals`: a standard normal number for each entry, where there is noise.
///
/// # Panics
/// If a slice is too short.
pub fn write_state(
    rules: &Rules,
    now: &EpisodeMoment<'_>,
    normals: Option<&[f64]>,
    out: &mut [f32],
) -> bool {
    let shared = now.reading[..rules.n_shared()].iter().copied();
    let mut is_finite = write(rules, 0, shared, normals, out);
    for (start, size, value) in rules.own_entries() {
        is_finite &= match value {
            ChannelValue::Action => {
                let action = now.progress.previous_action.iter().copied();
                write(rules, *start, action, normals, out)
            }
            ChannelValue::Episode(value) => {
                let entries = (0..*size).map(|i| value(now, i));
                write(rules, *start, entries, normals, out)
            }
            ChannelValue::Reading | ChannelValue::Heights => true,
        };
    }
    is_finite
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
    write(
        rules,
        rules.n_state(),
        heights.iter().copied(),
        normals,
        out,
    )
}

/// Writes values from entry `start` on.
#[allow(clippy::cast_possible_truncation)] // float32 is what an agent gets
fn write(
    rules: &Rules,
    start: usize,
    values: impl ExactSizeIterator<Item = f64>,
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
