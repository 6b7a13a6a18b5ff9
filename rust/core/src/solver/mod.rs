//! Solvers of the friction-contact problem. The usual entry point is [`solve`]; a solver sees only `(W, q, μ)`.
//!
//! - [`one_contact`]: the exact solution of a single contact, the brick of Gauss–Seidel;
//! - `nsgs`: nonsmooth Gauss–Seidel, cheap sweeps, good with many contacts;
//! - `newton`: semismooth Newton on the contact modes, quadratic near the answer;
//! - `guided`: few contacts from rest, a few sweeps for the modes and Newton with them;
//! - `pivoting`: one contact changes its mode at a time, from a warm start that full Newton steps do not profit from;
//! - `proximal`: the proximal-point method around Newton, for whatever resists (redundant contacts, jammed stacks);
//! - `admm`: alternating directions, and with them the convex relaxation of Coulomb's law, both for comparison;
//! - [`solve_body_pairs`]: accelerated Gauss–Seidel on the bodies' velocities, for thousands of free bodies;
//! - `block_lu`: the sparse factors of a Newton step of many contacts.
//!
//! All stand behind the trait [`Solver`]; [`Method`] names them.
//! [`Method::Auto`] takes few contacts to Newton at once and many to Gauss–Seidel first, and escalates when progress stops.
//! Every report is computed from the returned impulse, never from inside an iteration.

mod linear;
mod local;
mod options;
mod reference;
mod report;
mod scratch;
mod solve;
mod stage;
mod strategy;
mod work;
mod workspace;

pub use local::one_contact::{OneContactSolution, solve_one_contact};
pub use options::{ContactLaw, Method, SolverOptions};
pub use report::{Rung, Rungs, SolveReport, SolveStatus, Stage};
pub use solve::{solve, solve_many_bodies};
pub use stage::body_sweeps::{BodySweeps, solve_body_pairs};
pub use strategy::many_bodies::ManyBodies;
pub use workspace::SolverWorkspace;
