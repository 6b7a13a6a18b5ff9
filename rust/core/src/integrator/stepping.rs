//! The interface of a time-stepping scheme.

use super::error::StepError;
use super::mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem};
use super::options::StepOptions;
use super::probe::Probe;
use super::report::StepReport;
use super::scratch::{ScratchOf, StateMut};
use super::warm_start::WarmStart;

/// A time-stepping scheme for systems `S`.
pub trait Integrator<S: MechanicalSystem> {
    /// Takes one step, or leaves `state` and `warm_start` as they were.
    ///
    /// # Errors
    /// `NonFinite` or `SingularMassMatrix`. A solver that did not converge is not an error; the
    /// report says so.
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, ConfigurationOf<S>>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError>;
}
