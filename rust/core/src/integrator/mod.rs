//! Time stepping of measure differential inclusions: `M dv + (N v + G) dt = T u dt + H dp`.
//!
//! | scheme | file | order in smooth phases | through impacts |
//! |---|---|---|---|
//! | Moreau–Jean, one linearised step | [`moreau_jean`] | 2, gyroscopic terms explicit or implicit by the spin | 1 |
//! | Moreau–Jean, Newton on the end-of-step forces | [`moreau_jean_newton`] | 2 | 1 |
//!
//! Both schemes treat impacts and persistent contact by the same law at velocity level and locate
//! no events. [`position_projection`] removes the penetration that the velocity law leaves.
//! [`energy_audit`] checks the energy of every step. `held_step` differentiates a step while the
//! modes of its contacts ([`contact_modes`]) hold.
//!
//! Each scheme is written once, for any [`MechanicalSystem`]: the multibody tree and the planar
//! systems ([`crate::system`], [`crate::planar`]) step through the same code.

pub mod accuracy;
pub mod contact_modes;
pub mod energy_audit;
pub mod error;
pub(crate) mod held_step;
pub mod mechanical_system;
pub mod moreau_jean;
pub mod moreau_jean_newton;
pub mod options;
pub mod position_projection;
pub mod probe;
pub mod report;
pub mod scratch;
pub mod warm_start;

pub use accuracy::Accuracy;
pub use contact_modes::ContactMode;
pub use energy_audit::MechanicalEnergy;
pub use error::{OptionsError, StepError};
pub use mechanical_system::{MechanicalSystem, Start, UnilateralContact};
pub use options::{Stabilisation, StepOptions, Variant};
pub use probe::{NoProbe, Phase, Probe};
pub use report::{StepReport, StepStatus};
pub use scratch::Scratch;
pub use warm_start::WarmStart;

/// Key of a system's contacts.
pub type KeyOf<S> = <<S as MechanicalSystem>::Contact as UnilateralContact>::Key;

/// Scratch of a system's steps.
pub type ScratchOf<S> =
    Scratch<<S as MechanicalSystem>::Configuration, <S as MechanicalSystem>::Contact>;

/// The state that a step advances.
#[derive(Debug)]
pub struct StateMut<'a, Q> {
    /// Configuration.
    pub configuration: &'a mut Q,
    /// Velocity (nv).
    pub v: &'a mut [f64],
    /// s.
    pub time: &'a mut f64,
}

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
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError>;
}

/// Dispatches to the scheme of the variant; no other place chooses it.
impl<S: MechanicalSystem> Integrator<S> for Variant {
    #[inline]
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let (linearised, newton) = (
            moreau_jean::MoreauJean,
            moreau_jean_newton::MoreauJeanNewton,
        );
        match self {
            Self::Linearised => linearised.step(system, options, state, warm_start, scratch, probe),
            Self::Newton => newton.step(system, options, state, warm_start, scratch, probe),
        }
    }
}
