//! Scratch of a rover's fast steps: a block of one lane.

use std::sync::OnceLock;

use crate::lanes::problem::ContactProblem;
use crate::lanes::queue::Queue;
use crate::lanes::step::Block;
use crate::solver::SolverOptions;

/// A block of one lane, made when first needed. It holds no state: a copy has no block, only the
/// operator of the last step.
#[derive(Default)]
pub(super) struct Quick {
    pub(super) block: Option<Box<Block<f64>>>,
    /// The solver's scratch.
    pub(super) queue: Option<Box<Queue<f64>>>,
    pub(super) problem: Box<[ContactProblem; 1]>,
    pub(super) gap_problem: Box<[ContactProblem; 1]>,
    /// Whether the last step was taken here.
    is_last: bool,
    /// The operator of the last step, once somebody has asked for it.
    operator: OnceLock<Vec<f64>>,
}

impl Clone for Quick {
    fn clone(&self) -> Self {
        let operator = OnceLock::new();
        if let Some(own) = self.operator() {
            operator.get_or_init(|| own.to_vec());
        }
        Self {
            is_last: self.is_last,
            operator,
            ..Self::default()
        }
    }
}

impl std::fmt::Debug for Quick {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Quick").finish_non_exhaustive()
    }
}

impl Quick {
    /// Notes whether the last step was taken here.
    pub(super) fn set_last(&mut self, is_last: bool) {
        self.is_last = is_last;
        self.operator.take();
    }

    /// Delassus operator of the last step, row-major, 1/kg; none if it was not taken here.
    pub(super) fn operator(&self) -> Option<&[f64]> {
        let operator = || self.problem[0].operator();
        self.is_last
            .then(|| &self.operator.get_or_init(operator)[..])
    }

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
