//! Scratch memory of a solve, kept between solves so that none of them allocates.

use super::history::Iterate;
use super::scratch::SolveScratch;
use super::stage::body_sweeps::BodySweeps;
use super::strategy::islands::Islands;
use crate::problem::{Scales, Storage};

/// Scratch of [`solve`](crate::solver::solve). It grows to the largest problem solved and carries
/// no information from one solve to the next.
///
/// Up to [`direct_contacts`](crate::solver::SolverOptions::direct_contacts) contacts a solve in a
/// sized workspace allocates nothing. With more, a solve that Gauss–Seidel does not finish builds
/// the pattern of the sparse factors anew.
#[derive(Clone, Debug, Default)]
pub struct SolverWorkspace {
    /// The problem's scales.
    pub(super) scales: Scales,
    /// `W` in the storage that suits its size.
    pub(super) storage: Storage,
    /// Scratch of the stages.
    pub(super) scratch: SolveScratch,
    /// Scratch of the sweeps over pairs of bodies.
    pub(super) body_sweeps: BodySweeps,
    /// Problems of the islands, and the workspace that solves them. Created when first needed,
    /// since workspaces would otherwise nest without end.
    pub(super) islands: Islands,
    pub(super) nested: Option<Box<SolverWorkspace>>,
}

impl SolverWorkspace {
    /// Empty scratch; the first solve sizes it.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The residuals that the last solve measured, if its options asked for them
    /// ([`keeps_history`](crate::solver::SolverOptions::keeps_history)).
    ///
    /// Gauss–Seidel and ADMM measure every few iterations, the others at every step. Islands give
    /// one entry, when all are solved; sweeps over pairs of bodies give none.
    #[must_use]
    pub fn history(&self) -> &[Iterate] {
        self.scratch.history.as_slice()
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
