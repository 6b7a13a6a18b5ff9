//! Scratch of a rover's fast steps: a block of one lane.

use crate::lanes::problem::ContactProblem;
use crate::lanes::queue::Queue;
use crate::lanes::step::Block;
use crate::solver::SolverOptions;

/// A block of one lane, made when first needed. It holds no state: a copy has none.
#[derive(Default)]
pub(super) struct Quick {
    pub(super) block: Option<Box<Block<f64>>>,
    /// The solver's scratch.
    pub(super) queue: Option<Box<Queue<f64>>>,
    pub(super) problem: Box<[ContactProblem; 1]>,
    pub(super) gap_problem: Box<[ContactProblem; 1]>,
    /// Whether the last step was taken here.
    pub(super) is_last: bool,
}

impl Clone for Quick {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Quick {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Quick").finish_non_exhaustive()
    }
}

impl Quick {
    /// The problem of the last step taken here, and its block.
    pub(super) fn last(&self) -> Option<(&Block<f64>, &ContactProblem)> {
        let block = self.block.as_deref().filter(|_| self.is_last)?;
        Some((block, &self.problem[0]))
    }
}

/// Solves one problem.
pub(super) fn solve(
    queue: &mut Queue<f64>,
    problem: &mut [ContactProblem],
    options: &SolverOptions,
) {
    queue.begin(1);
    queue.enter(0, problem, |_| true);
    while queue.next_group(problem, options).is_some() {}
}
