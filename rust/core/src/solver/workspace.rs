//! Scratch memory of a solve, kept between solves so that none of them allocates.

use super::scratch::Scratch;
use super::stage::body_sweeps::BodySweeps;
use super::strategy::islands::Islands;
use crate::problem::{Scales, Storage};

/// Scratch of [`solve`](crate::solver::solve): grows to the largest problem
/// met, carries nothing from one solve to the next.
///
/// Up to [`direct_contacts`](crate::solver::SolverOptions::direct_contacts) a
/// solve in a sized workspace allocates nothing; above, the pattern of the
/// sparse factors is made anew where Gauss–Seidel does not answer.
#[derive(Clone, Debug, Default)]
pub struct SolverWorkspace {
    /// The problem's scales.
    pub(super) scales: Scales,
    /// `W` in the storage that suits its size.
    pub(super) storage: Storage,
    /// Of the stages.
    pub(super) scratch: Scratch,
    /// Of the sweeps over pairs of bodies.
    pub(super) body_sweeps: BodySweeps,
    /// Problems of the islands, and the workspace that they are solved in: made
    /// at the first need, or workspaces would nest for ever.
    pub(super) islands: Islands,
    pub(super) nested: Option<Box<SolverWorkspace>>,
}

impl SolverWorkspace {
    /// Empty scratch; it sizes itself at the first solve.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Scratch for problems of up to `n_contacts` contacts of `components`
    /// components, so that no solve allocates.
    #[must_use]
    pub fn with_capacity(n_contacts: usize, components: usize) -> Self {
        let mut workspace = Self::default();
        let n = n_contacts * components;
        workspace.scales.resize(n_contacts);
        workspace.scratch.resize(n_contacts, n);
        workspace.scratch.system.resize_dense(n);
        workspace
    }
}
