//! Which options have a fast step.

use thiserror::Error;

use super::machine::Unsupported;
use crate::integrator::{StepOptions, Variant};
use crate::solver::Method;

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
    /// The solver's method is not [`Method::Auto`].
    #[error("solver is not \"auto\"")]
    Method,
}

/// Whether these options have a fast step.
///
/// # Errors
/// Why they have none.
#[inline]
pub fn admit(options: &StepOptions) -> Result<(), FallbackReason> {
    if options.variant != Variant::Linearised {
        Err(FallbackReason::Variant)
    } else if options.solver.method != Method::Auto {
        Err(FallbackReason::Method)
    } else {
        Ok(())
    }
}
