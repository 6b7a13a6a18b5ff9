//! Contact with friction between rigid bodies: laws, problems and solvers.
//!
//! A problem is what one time step leaves of a mechanical system: the Delassus operator
//! `W = Hᵀ M⁻¹ H`, the free velocity `q` of every contact and its coefficient of friction μ. Find
//! the impulses p with
//!
//! ```text
//! u = W p + q,    ũ = u + μ |u_T| n,    K_μ* ∋ ũ ⊥ p ∈ K_μ    at every contact.
//! ```
//!
//! A box on a slope:
//!
//! ```no_run
#![doc = include_str!("../examples/slope.rs")]
//! ```
//!
//! Chapters, each using only those above it:
//!
//! - [`quantity`]: admissible numbers of a description; [`scalar`]: one problem or several to a
//!   register; [`space`]: formulas of the plane and of space; [`pool`]: threads that survive a
//!   fork;
//! - [`cone`], [`law`]: the friction cone and the contact laws, one contact at a time;
//! - [`problem`]: the problem of all contacts, and how well an answer solves it;
//! - [`solver`]: the methods.
//!
//! Nothing here knows a body or a machine.
#![forbid(unsafe_code)]
// Same bits on every machine: sines and their like come from `scalar::elementary`.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub use nalgebra;

pub mod cone;
pub mod law;
pub mod pool;
pub mod problem;
pub mod quantity;
pub mod scalar;
pub mod solver;
pub mod space;
