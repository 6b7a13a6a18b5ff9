//! Solvers of the friction-contact problem. The usual entry point is
//! [`solve`]; a solver sees only `(W, q, μ)`.
//!
//! The chapter stands in floors, and no page knows one of a higher floor. From the ground up:
//!
//! - `options`, `report`, `work`: what a caller may choose, what comes
//!   back, and how work is counted;
//! - `local`: one contact with the others held, its exact
//!   [solution](solve_one_contact) and its mode;
//! - `linear`: the system of a Newton step and its factors, dense or in sparse blocks;
//! - `scratch`: what the stages share;
//! - `stage`: the iterations, a file each;
//! - `strategy`: which stage when; `reference`: answers to compare with;
//! - `workspace` and `entry`: from the caller's problem to the judged answer.
//!
//! The problem itself, its scales and its residual lie below all of them, in [`crate::problem`]. A
//! [`Method`] names a stage or, as [`Method::Auto`], the escalation over them. Every report is
//! computed from the returned impulse, never from inside an iteration.
//!
//! # The escalation
//!
//! What [`Method::Auto`] tries, in this order, until an answer holds.
//! `docs/solvers.md` says how the last column was measured.
//!
#![doc = include_str!("escalation.md")]

mod entry;
mod linear;
mod local;
mod options;
mod reference;
mod report;
mod scratch;
mod stage;
mod strategy;
mod work;
mod workspace;

pub use entry::{solve, solve_many_bodies};
pub use local::one_contact::{OneContactSolution, solve_one_contact};
pub use options::{ContactLaw, Method, SolverOptions};
pub use report::{Rung, Rungs, SolveReport, SolveStatus, Stage};
pub use stage::body_sweeps::{BodySweeps, Swept, solve_body_pairs};
pub use strategy::many_bodies::ManyBodies;
pub use workspace::SolverWorkspace;
