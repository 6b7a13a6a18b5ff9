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

mod admm;
mod auto;
mod block_lu;
mod dense;
mod guided;
mod islands;
mod methods;
mod modes;
mod newton;
mod nsgs;
pub mod one_contact;
mod options;
mod pivoting;
mod proximal;
mod reduced_system;
mod report;
mod restarts;
mod stage;
mod storage;
mod work;
mod workspace;

pub use methods::{
    Admm, Automatic, ContactLaw, GaussSeidel, Newton, ProximalPoint, Relaxed, Solver,
};
pub use options::{Method, SolverOptions};
pub use report::{Rung, Rungs, SolveReport, SolveStatus, Stage};
pub use stage::body_sweeps::{BodySweeps, LocalProblem, Swept, solve_body_pairs};
pub use workspace::SolverWorkspace;

use crate::problem::FrictionContactProblem;

/// Solves `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = W p + q`.
///
/// `p` (n), N s: in, the warm start or zeros; out, the impulses, inside the friction cones up to the report's residual.
/// `u` (n), m/s: out, `W p + q` of the returned `p`. `workspace` may have served any other problem before; it influences
/// no bit of the answer, and allocates only when a problem is larger than all before.
///
/// From `p = 0` and few contacts the answer is the one next to zero (Tikhonov's limit), so a symmetric problem has a
/// symmetric answer and the order of the contacts does not matter; from a warm start it is the one next to the warm start.
///
/// Not converged is an answer, see [`SolveStatus`]: then `p` is the best impulse met by any stage. The work is bounded, see
/// [`SolverOptions::budget`]. Where `q = 0` the answer is zero, whatever the warm start. Data or warm start that are not finite
/// never come out again: with bad data `p` and `u` are zero and the status is [`SolveStatus::NonFinite`]; a bad warm start
/// counts as zeros.
///
/// # Panics
/// If `p` or `u` has not the problem's number of unknowns.
pub fn solve(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    match options.method {
        // The time stepper's choice, without the detour of a virtual call.
        Method::Auto => methods::solve_by::<Automatic>(problem, options, p, u, workspace),
        method => method.solver().solve(problem, options, p, u, workspace),
    }
}
