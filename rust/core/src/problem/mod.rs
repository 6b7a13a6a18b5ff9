//! The friction-contact problem of one time step, and the measure of how well it is solved.
//!
//! Given the Delassus operator `W = Hᵀ M⁻¹ H`, the free local velocity `q` and the friction coefficients `μ`, find the
//! impulses `p` such that
//!
//! ```text
//! u = W p + q,    ũ = u + μ|u_T| n,    K_μ* ∋ ũ ⊥ p ∈ K_μ    at every contact.
//! ```
//!
//! [`FrictionContactProblem`] states it, with `W` dense or, for many contacts, as [`BlockSparseDelassus`]; [`Residual`] judges an answer. Nothing here knows a body, so a problem read
//! from a file is as good as one from a rover.

mod friction_contact;
mod operator;
mod passivity;
mod residual;

pub use friction_contact::{Dimension, FrictionContactProblem, ProblemError};
pub use operator::{BlockSparseDelassus, BodyPairs, Operator, PairContact, RoundPair};
pub(crate) use operator::{dot, rim_impulse, rim_velocity};
pub(crate) use passivity::passive_share;
pub use residual::{
    ContactScales, Residual, contact_scales, evaluate, evaluate_into, local_velocity,
};
pub(crate) use residual::{Magnitudes, Violations, evaluate_contact, power_of_two};
