//! Scratch of a rover's ordinary steps: a block of one lane.

use crate::lanes::problem::ContactProblem;
use crate::lanes::queue::{Queue, solve_all};
use crate::lanes::step::Block;
use crate::scalar::Single;
use crate::solver::SolverOptions;

/// A block of one lane, made when first needed. It holds no state: a copy has none.
#[derive(Default)]
pub(super) struct Quick {
    pub(super) block: Option<Box<Block<f64>>>,
    /// Solves problems with factors, made when first needed.
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

/// Solves a problem; with factors in the queue, which is made when first needed.
pub(super) fn solve(
    problem: &mut [ContactProblem; 1],
    queue: &mut Option<Box<Queue<f64>>>,
    options: &SolverOptions,
) {
    let token = Single::best();
    if problem[0].is_factored() {
        let queue = queue.get_or_insert_with(|| Box::new(Queue::new(token)));
        queue.solve_all(&mut problem[..], options);
    } else {
        solve_all::<f64>(token, &mut problem[..], options);
    }
}
