//! The friction-contact problem of one time step, and the measure of how well it is solved.
//!
//! Given the Delassus operator `W = Hᵀ M⁻¹ H`, the free local velocity `q` and the friction
//! coefficients `μ`, find the impulses `p` such that
//!
//! ```text
//! u = W p + q,    ũ = u + μ|u_T| n,    K_μ* ∋ ũ ⊥ p ∈ K_μ    at every contact.
//! ```
//!
//! - `friction_contact`: [`FrictionContactProblem`] states the problem. It knows no bodies, so a
//!   problem read from a file is as good as one from a rover.
//! - `operator`: `W`, dense or, for many contacts, as [`BlockSparseDelassus`]; [`BodyPairs`]
//!   replaces it for very many free bodies.
//! - `scales`: factors between the velocity and the impulse of a contact.
//! - `residual`: [`Residual`] judges an answer.
//! - `prepared`: a problem together with its scales, for iterative methods.
//! - `redundancy`, `least_in_cones`: impulses that the motion leaves open, and the least of them.
//! - `passivity`: scales down an approximate answer that would add energy.
//!
//! # One call
//!
//! ```text
//! W, q, μ ──► FrictionContactProblem         checked: sizes, finite numbers, μ ≥ 0
//!                  │
//!                  ▼
//!             Prepared                       with scales ρ of every contact, for iterative methods
//!                  │
//!                  ▼  a solver's p
//!             evaluate                       u = W p + q, residual of the law at every contact
//!                  │
//!                  ▼
//!             passive_share                  how much of an approximate p adds no energy
//! ```
//!
//! # May use
//!
//! [`crate::space`], [`crate::law`].
//!
//! No solver and no body: a problem read from a file is as good as one from a rover.

mod dimension;
mod error;
mod friction_contact;
mod least_in_cones;
mod operator;
mod passivity;
mod prepared;
mod redundancy;
mod residual;
mod rolling;
mod scales;

pub use dimension::Dimension;
pub use error::ProblemError;
pub use friction_contact::FrictionContactProblem;
pub use operator::{BlockSparseDelassus, BodyPairs, Operator, PairContact, RoundPair};
pub(crate) use operator::{Storage, dot};
pub(crate) use passivity::passive_share;
pub(crate) use prepared::{Prepared, Proximal};
pub(crate) use redundancy::{Answered, Settled};
pub use redundancy::{Redundancy, undetermined_loads};
pub(crate) use residual::{Magnitudes, ViolationSums, evaluate_contact};
pub use residual::{Residual, evaluate, evaluate_into};
pub use rolling::RollingContact;
pub(crate) use scales::{ContactScales, Scales, power_of_two};
