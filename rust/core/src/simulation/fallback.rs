//! Whether a rover has fast steps, and how many rovers share a register then.

use super::rover::RoverSimulation;
use crate::lanes::admission::FallbackReason;
use crate::scalar::Instructions;

impl RoverSimulation {
    /// Why all of its steps are general; None if [`crate::lanes`] takes them, save those that its
    /// report counts as fallbacks.
    #[must_use]
    pub fn fallback_reason(&self) -> Option<FallbackReason> {
        self.scene.fallback_reason(&self.options)
    }

    /// Rovers to a register in its fast steps, in a batch on this machine; 1 if it has none.
    #[must_use]
    pub fn lanes(&self) -> usize {
        match self.fallback_reason() {
            Some(_) => 1,
            None => Instructions::of_this_machine().lanes(),
        }
    }
}
