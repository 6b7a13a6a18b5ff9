//! The scheme of each variant.

use super::error::StepError;
use super::mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem};
use super::moreau_jean::MoreauJean;
use super::moreau_jean_newton::MoreauJeanNewton;
use super::options::{StepOptions, Variant};
use super::probe::Probe;
use super::report::StepReport;
use super::scratch::{ScratchOf, StateMut};
use super::stepping::Integrator;
use super::warm_start::WarmStart;

/// Dispatches to the scheme of the variant; no other place chooses it.
impl<S: MechanicalSystem> Integrator<S> for Variant {
    #[inline]
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, ConfigurationOf<S>>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let (linearised, newton) = (MoreauJean, MoreauJeanNewton);
        match self {
            Self::Linearised => linearised.step(system, options, state, warm_start, scratch, probe),
            Self::Newton => newton.step(system, options, state, warm_start, scratch, probe),
        }
    }
}
