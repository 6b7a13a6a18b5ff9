//! Whether a rover has fast steps, and how many rovers share a register then.

use super::rover::RoverSimulation;
use crate::lanes::admission::FallbackReason;
use crate::scalar::Instructions;

impl RoverSimulation {
    /// Why all of its steps are general; None if [`crate::lanes`] takes them, save those that its
    /// report counts as fallbacks.
    #[must_use]
    pub fn fallback_reason(&self) -> Option<FallbackReason> {
        let own = self.scene.fallback_reason(&self.options);
        let is_pushed = !self.command.actuators.wrenches.is_empty();
        own.or(is_pushed.then_some(FallbackReason::Wrench))
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
