//! Whether the steps of a rover are ordinary, and if not, why.

use thiserror::Error;

use super::machine::NotOrdinary;
use crate::integrator::{StepOptions, Variant};
use crate::solver::Method;

/// Why no step of a rover is ordinary.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NeverOrdinary {
    /// The machine has no ordinary step.
    #[error(transparent)]
    Machine(#[from] NotOrdinary),
    /// The variant is not [`Variant::Linearised`].
    #[error("the variant is Newton's")]
    Variant,
    /// The ground is a surface and wheels have a width.
    #[error("wheels with a width are on a surface")]
    WideWheelsOnSurface,
    /// Wheels sink into the ground.
    #[error("the ground is soft")]
    SoftGround,
    /// Contacts bounce.
    #[error("the restitution is {0}, not 0")]
    Restitution(f64),
    /// Pairs of materials have laws of their own.
    #[error("pairs of materials have laws of their own")]
    Materials,
    /// The solver does not start from the last impulses.
    #[error("the warm start is off")]
    WarmStart,
    /// The solver's method is not [`Method::Auto`].
    #[error("the solver's method is chosen, not automatic")]
    Method,
}

/// Whether steps with these options can be ordinary.
///
/// # Errors
/// Why they cannot.
#[inline]
pub fn admit(options: &StepOptions) -> Result<(), NeverOrdinary> {
    if options.variant != Variant::Linearised {
        Err(NeverOrdinary::Variant)
    } else if options.restitution != 0.0 {
        Err(NeverOrdinary::Restitution(options.restitution))
    } else if !options.materials.is_empty() {
        Err(NeverOrdinary::Materials)
    } else if !options.warm_start {
        Err(NeverOrdinary::WarmStart)
    } else if options.solver.method != Method::Auto {
        Err(NeverOrdinary::Method)
    } else {
        Ok(())
    }
}
