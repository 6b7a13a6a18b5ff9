//! Time stepping of measure differential inclusions: `M dv + (N v + G) dt = T u dt + H dp`.
//!
//! | scheme | file | order in smooth phases | through impacts |
//! |---|---|---|---|
//! | Moreau–Jean, one linearised step | [`moreau_jean`] | 2 in the position, explicit in the gyroscopic terms | 1 |
//! | Moreau–Jean, Newton on the end-of-step forces, in momentum form | [`moreau_jean_newton`] | 2 | 1 |
//!
//! Both treat impacts and persistent contact by the same law at velocity level and search for no event.
//! What the velocity law leaves of penetration, [`position_projection`] removes.

pub mod accuracy;
pub mod command;
pub mod error;
pub mod fitted_theta;
pub mod moreau_jean;
pub mod moreau_jean_newton;
pub mod options;
pub mod position_projection;
pub mod probe;
pub mod report;
pub mod workspace;

pub use accuracy::Accuracy;
pub use command::{Command, HeldJoint};
pub use error::{OptionsError, StepError};
pub use options::{Stabilisation, StepOptions, Variant};
pub use probe::{NoProbe, Phase, Probe};
pub use report::{StepReport, StepStatus};
pub use workspace::{ActiveContact, WarmStart, Workspace};

use crate::geometry::Terrain;
use crate::multibody::{Model, State};

/// What a step works on, beside state and scratch.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The machine.
    pub model: &'a Model,
    /// The ground.
    pub terrain: &'a dyn Terrain,
    /// Step, scheme, laws, tolerances.
    pub options: &'a StepOptions,
}

/// A time-stepping scheme.
pub trait Integrator {
    /// Takes one step, or leaves `state` and `warm_start` as they were.
    ///
    /// # Errors
    /// `NonFinite` or `SingularMassMatrix`. A solver that did not converge is no error: see the report.
    fn step(
        &self,
        scene: &Scene<'_>,
        command: &Command,
        state: &mut State,
        warm_start: &mut WarmStart,
        workspace: &mut Workspace,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError>;
}

impl Variant {
    /// The scheme of a variant: the one place where it is chosen.
    #[must_use]
    pub fn integrator(self) -> &'static dyn Integrator {
        match self {
            Self::Linearised => &moreau_jean::MoreauJean,
            Self::Newton => &moreau_jean_newton::MoreauJeanNewton,
        }
    }
}
