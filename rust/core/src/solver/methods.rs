//! The solvers behind one trait: same problem in, same report out, judged by the same measure.

use super::auto::{Prepared, solve_in};
use super::nsgs::{self, Budget};
use super::report::{SolveReport, SolveStatus, Stage};
use super::workspace::SolverWorkspace;
use super::{Method, SolverOptions, admm, auto, newton, proximal};
use crate::problem::{Dimension, FrictionContactProblem, Residual};

/// The contact law that an answer obeys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ContactLaw {
    /// Signorini's condition with Coulomb's friction, `K* ∋ u + μ|u_T| n ⊥ p ∈ K`.
    Coulomb,
    /// The convex relaxation `K* ∋ u ⊥ p ∈ K`: a sliding contact parts with `μ|u_T|`.
    Relaxed,
}

/// A solver of the friction-contact problem. All of them take two and three components, dense and block-sparse `W`, and an unsymmetric
/// `W` as it is.
pub trait Solver: Sync {
    /// Which method this is.
    fn method(&self) -> Method;

    /// Its public name.
    fn name(&self) -> &'static str {
        self.method().name()
    }

    /// The law that its answers obey.
    fn law(&self) -> ContactLaw {
        self.method().law()
    }

    /// Solves as [`solve`](super::solve) does, whatever `options.method` says.
    ///
    /// # Panics
    /// If `p` or `u` has not the problem's number of unknowns.
    fn solve(
        &self,
        problem: &FrictionContactProblem<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport;
}

/// What an iteration hands to the judge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    /// The method that answered.
    pub method: Method,
    /// Its stage.
    pub stage: Stage,
    /// Why it stopped.
    pub status: SolveStatus,
    /// Its residual under Coulomb's law.
    pub residual: Residual,
}

impl Outcome {
    /// Of the only stage of a method, which is entered into the list of stages.
    fn of_one(
        (method, stage): (Method, Stage),
        (status, residual): (SolveStatus, Residual),
        iterations: usize,
        workspace: &mut SolverWorkspace,
    ) -> Self {
        let status = workspace.list_stage(stage, status, iterations);
        Self {
            method,
            stage,
            status,
            residual,
        }
    }
}

/// An iteration in dimension `D`, from `p`; `u` is `W p + q` on return.
pub(super) trait Algorithm: Sync {
    /// Which method this is.
    const METHOD: Method;

    /// Iterates on prepared data; `iterations` is advanced by the sweeps and linear solves.
    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome;
}

impl<A: Algorithm> Solver for A {
    fn method(&self) -> Method {
        A::METHOD
    }

    fn solve(
        &self,
        problem: &FrictionContactProblem<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        solve_by::<A>(problem, options, p, u, workspace)
    }
}

/// Solves with one algorithm.
#[inline]
pub(super) fn solve_by<A: Algorithm>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    assert!(
        p.len() == problem.n_unknowns(),
        "p must have one entry per unknown"
    );
    assert!(
        u.len() == problem.n_unknowns(),
        "u must have one entry per unknown"
    );
    match problem.dimension() {
        Dimension::Two => solve_in::<A, 2>(problem, options, p, u, workspace),
        Dimension::Three => solve_in::<A, 3>(problem, options, p, u, workspace),
    }
}

/// [`Method::Auto`].
#[derive(Clone, Copy, Debug)]
pub struct Automatic;

impl Algorithm for Automatic {
    const METHOD: Method = Method::Auto;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        auto::escalate::<D>(data, options, p, u, workspace, iterations)
    }
}

/// [`Method::GaussSeidel`].
#[derive(Clone, Copy, Debug)]
pub struct GaussSeidel;

impl Algorithm for GaussSeidel {
    const METHOD: Method = Method::GaussSeidel;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        let budget = Budget {
            sweeps: options.max_sweeps,
            predict: false,
        };
        workspace.start.copy_from_slice(p);
        let found = nsgs::sweeps::<D>(data, options, budget, p, u, workspace, iterations);
        Outcome::of_one((Self::METHOD, Stage::Sweeps), found, *iterations, workspace)
    }
}

/// [`Method::Newton`].
#[derive(Clone, Copy, Debug)]
pub struct Newton;

impl Algorithm for Newton {
    const METHOD: Method = Method::Newton;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        let steps = options.max_newton_steps;
        let found = newton::full_steps::<D>(data, options, steps, p, u, workspace, iterations);
        Outcome::of_one((Self::METHOD, Stage::Newton), found, *iterations, workspace)
    }
}

/// [`Method::ProximalPoint`].
#[derive(Clone, Copy, Debug)]
pub struct ProximalPoint;

impl Algorithm for ProximalPoint {
    const METHOD: Method = Method::ProximalPoint;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        workspace.start.copy_from_slice(p);
        let found = proximal::solve::<D>(data, options, p, u, workspace, iterations);
        let stage = (Self::METHOD, Stage::ProximalPoint);
        Outcome::of_one(stage, found, *iterations, workspace)
    }
}

/// [`Method::Admm`].
#[derive(Clone, Copy, Debug)]
pub struct Admm;

impl Algorithm for Admm {
    const METHOD: Method = Method::Admm;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        let law = ContactLaw::Coulomb;
        let found = admm::solve::<D>(data, options, law, p, u, workspace, iterations);
        Outcome::of_one((Self::METHOD, Stage::Admm), found, *iterations, workspace)
    }
}

/// [`Method::Relaxed`].
#[derive(Clone, Copy, Debug)]
pub struct Relaxed;

impl Algorithm for Relaxed {
    const METHOD: Method = Method::Relaxed;

    fn run<const D: usize>(
        data: &Prepared<'_>,
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
        iterations: &mut usize,
    ) -> Outcome {
        let law = ContactLaw::Relaxed;
        let found = admm::solve::<D>(data, options, law, p, u, workspace, iterations);
        Outcome::of_one(
            (Self::METHOD, Stage::Relaxed),
            found,
            *iterations,
            workspace,
        )
    }
}
