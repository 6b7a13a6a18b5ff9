//! Whether and why an episode ends.

use serde::{Deserialize, Serialize};

/// Why an episode has ended, in the order of the codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ending {
    /// The episode has not ended.
    #[default]
    None,
    /// The trunk's origin is within the tolerance of the last goal.
    Goal,
    /// The trunk leans too far.
    RollOver,
    /// The trunk has carried the weight for too long.
    HighCentred,
    /// The physics could not take a step, or gave numbers that float32 cannot hold.
    StepFailed,
    /// The motors have used up the battery.
    BatteryEmpty,
    /// The rover that was held has come free.
    Free,
    /// The trunk's origin has left the field.
    LeftField,
}

impl Ending {
    /// All, by their code.
    pub const ALL: [Self; 8] = [
        Self::None,
        Self::Goal,
        Self::RollOver,
        Self::HighCentred,
        Self::StepFailed,
        Self::BatteryEmpty,
        Self::Free,
        Self::LeftField,
    ];

    /// Name of the ending; empty while the episode runs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Goal => "goal",
            Self::RollOver => "roll_over",
            Self::HighCentred => "high_centred",
            Self::StepFailed => "step_failed",
            Self::BatteryEmpty => "battery_empty",
            Self::Free => "free",
            Self::LeftField => "left_field",
        }
    }

    /// Whether the episode has ended.
    #[must_use]
    pub fn is_end(self) -> bool {
        self != Self::None
    }

    /// Whether the episode has ended at the goal, or with the rover free.
    #[must_use]
    pub fn is_success(self) -> bool {
        matches!(self, Self::Goal | Self::Free)
    }

    /// Whether the episode has ended without success.
    #[must_use]
    pub fn is_failure(self) -> bool {
        self.is_end() && !self.is_success()
    }
}
