//! Whether a rover's steps are ordinary, and how many rovers share a register then.

use super::rover::RoverSimulation;
use crate::lanes::admission::NeverOrdinary;
use crate::scalar::Instructions;

impl RoverSimulation {
    /// Why none of its steps is ordinary; None if they are, save those that [`crate::lanes`]
    /// declines.
    #[must_use]
    pub fn never_ordinary(&self) -> Option<NeverOrdinary> {
        self.scene.never_ordinary(&self.options)
    }

    /// Rovers to a register in its ordinary steps, in a batch on this machine; 1 if it has none.
    #[must_use]
    pub fn lanes(&self) -> usize {
        match self.never_ordinary() {
            Some(_) => 1,
            None => Instructions::of_this_machine().lanes(),
        }
    }
}
