//! Solvers of the friction-contact problem. The usual entry point is
//! [`solve`]; a solver sees only `(W, q, μ)`.
//!
//! The chapter is built in layers, and no module uses one of a higher layer. From the bottom up:
//!
//! - `options`, `report`, `history`, `work`, `draws`: the caller's options, the report, the
//!   residuals on the way, the count of work, and numbers that look random;
//! - `local`: one contact with all others fixed, answered by its law ([`crate::law`]), and its
//!   mode;
//! - `linear`: the linear system of a Newton step and its factors, dense or block-sparse;
//! - `pivoting`: pivoting on the contact modes, over any scalar, storage and linear system;
//! - [`batch`]: the problems of many machines at once, by pivoting;
//! - `scratch`: memory that the stages share;
//! - `stage`: the iterative methods, one per file;
//! - `strategy`: the order of the stages; `reference`: methods for comparison;
//! - `workspace` and `entry`: from the caller's problem to the answer and its report.
//!
//! The problem, its scales and its residual lie below all layers, in [`crate::problem`]. A
//! [`Method`] names a stage or, as [`Method::Auto`], the escalation over the stages. Every report
//! is computed from the returned impulse, never from the inside of an iteration.
//!
//! # One call
//!
//! ```text
//! solve(problem, options, p)
//!    │
//!    ├─ workspace                    W dense or block-sparse, and the scales of every contact
//!    ├─ strategy                     Auto: stage after stage until an answer holds
//!    │     └─ stage                  pivoting, sweeps, Newton, proximal, ...
//!    │           └─ local, linear    one contact; the linear system of all
//!    ├─ judge                        residual of the returned p; passivity
//!    ▼
//! SolveReport, p, u = W p + q
//! ```
//!
//! # May use
//!
//! [`crate::pool`], [`crate::scalar`], [`crate::space`], [`crate::cone`], [`crate::law`],
//! [`crate::problem`].
//!
//! No body: a solver sees `(W, q, μ)`, or pairs of bodies that give `W`.
//!
//! # The escalation
//!
//! What [`Method::Auto`] tries, in this order, until an answer holds.
//! `docs/solvers.md` says how the last column was measured.
//!
#![doc = include_str!("escalation.md")]

pub mod batch;
mod draws;
mod entry;
mod history;
mod linear;
mod local;
mod options;
pub(crate) mod pivoting;
mod reference;
mod report;
mod scratch;
mod stage;
mod strategy;
mod work;
mod workspace;

pub use crate::law::one_contact::{OneContactSolution, solve_one_contact};
pub use entry::{solve, solve_many_bodies, solve_poisson_impact, solve_with_laws};
pub use history::Iterate;
pub use options::{ContactLaw, Method, SolverOptions};
pub use report::{Rung, Rungs, SolveReport, SolveStatus, Stage};
pub use stage::body_sweeps::{BodySweeps, ContactSolution, Swept, solve_body_pairs};
pub use strategy::many_bodies::ManyBodies;
pub use workspace::SolverWorkspace;
