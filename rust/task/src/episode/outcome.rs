//! The outcome of a control period.

use super::ending::Ending;
use super::quantities::Quantities;
use super::reward::N_TERMS;
use serde::{Deserialize, Serialize};

/// The outcome of a control period, or the beginning of an episode, which earns nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Quantities at the end of the period.
    pub now: Quantities,
    /// Work of the motors since the episode began, J.
    pub energy: f64,
    /// Driving part of the motors' work since the episode began, J.
    pub energy_positive: f64,
    /// Terms of the reward, in the order of [`super::TERMS`].
    pub terms: [f64; N_TERMS],
    /// Their sum.
    pub reward: f64,
    /// Whether and how the episode has ended.
    pub ending: Ending,
}
