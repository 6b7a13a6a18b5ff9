//! Errors: rules, actions and episodes that are refused.

use thiserror::Error;

use crate::draw::DrawError;
use rover_core::simulation::BatchError;

/// What an episode or a batch of episodes refuses.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum EpisodeError {
    /// A list of a wrong length.
    #[error("{field}: needs {expected} entries, has {actual}")]
    Length {
        /// Name of the argument.
        field: &'static str,
        /// What the model and the rules need.
        expected: usize,
        /// What was given.
        actual: usize,
    },
    /// A number out of its range.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the argument.
        field: &'static str,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// An entry of an action outside [-1, 1].
    #[error("action{place}: must be within [-1, 1], is {value}")]
    Action {
        /// Index of the entry, in brackets: of the rover, where there are several, and of the
        /// entry.
        place: String,
        /// What was given.
        value: f64,
    },
    /// An episode of other rules than the batch's.
    #[error("episode: must have the rules of the batch")]
    OtherRules,
    /// A rover that has no episode yet.
    #[error("rover {index}: its episode has not begun")]
    NotBegun {
        /// Which rover.
        index: usize,
    },
    /// A rover that somebody else is stepping.
    #[error("a rover is being stepped by another call")]
    Busy,
    /// A given state whose observation is not finite in float32.
    #[error("q: with v and goal, must give an observation that is finite in float32")]
    NotObservable,
    /// Why no scene could be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// What the rovers of a batch refuse.
    #[error(transparent)]
    Batch(#[from] BatchError),
}

/// Refuses the first of some lists that has a wrong length: its name, its length and the one that
/// it needs.
pub(super) fn check_lengths(
    lists: impl IntoIterator<Item = (&'static str, usize, usize)>,
) -> Result<(), EpisodeError> {
    let wrong = lists
        .into_iter()
        .find(|(_, actual, expected)| actual != expected);
    wrong.map_or(Ok(()), |(field, actual, expected)| {
        Err(EpisodeError::Length {
            field,
            expected,
            actual,
        })
    })
}
