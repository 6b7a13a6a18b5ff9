//! Whether a rover has fast steps, and how many rovers share a register then.

use thiserror::Error;

use super::rover::{RoverScene, RoverSimulation};
use crate::integrator::{StepOptions, Variant};
use crate::lanes::machine::Unsupported;
use crate::scalar::Instructions;

/// Why all steps of a rover are general.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FallbackReason {
    /// The machine has no fast step.
    #[error(transparent)]
    Machine(#[from] Unsupported),
    /// The variant is not [`Variant::Linearised`].
    #[error("variant is \"newton\"")]
    Variant,
    /// Wheels sink into the ground and meet planes, surfaces or spheres of another kind there.
    #[error("wheels meet a firm plane or surface beside the soft ground, or spheres under it")]
    FirmBesideSoft,
}

impl RoverScene {
    /// Why with these options it has no fast steps.
    #[inline]
    pub(super) fn fallback_reason(&self, options: &StepOptions) -> Option<FallbackReason> {
        if self.terrain.soft().is_some_and(|layer| !layer.is_alone) {
            return Some(FallbackReason::FirmBesideSoft);
        }
        match &self.machine {
            _ if options.variant != Variant::Linearised => Some(FallbackReason::Variant),
            Err(why) => Some(why.clone().into()),
            Ok(_) => None,
        }
    }
}

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
