//! The block of one lane in which a rover takes its steps with the usual effort.

use std::sync::OnceLock;

use crate::solver::SolverOptions;
use crate::solver::batch::problem::ContactProblem;
use crate::solver::batch::queue::Queue;
use crate::system::block::RoverBlock;

/// A rover's own block, made when first needed. It holds no state: a copy has no block, only the
/// operator of the last step.
#[derive(Default)]
pub(super) struct OwnBlock {
    pub(super) block: Option<Box<RoverBlock<f64>>>,
    /// The solver's scratch.
    pub(super) queue: Option<Box<Queue<f64>>>,
    pub(super) problems: Vec<ContactProblem>,
    pub(super) gap_problems: Vec<ContactProblem>,
    /// Whether the last step was taken here.
    is_last: bool,
    /// The operator of the last step, once somebody has asked for it.
    operator: OnceLock<Vec<f64>>,
}

impl Clone for OwnBlock {
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

impl std::fmt::Debug for OwnBlock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OwnBlock").finish_non_exhaustive()
    }
}

impl OwnBlock {
    /// Notes whether the last step was taken here.
    pub(super) fn set_last(&mut self, is_last: bool) {
        self.is_last = is_last;
        self.operator.take();
    }

    /// Delassus operator of the last step, row-major, 1/kg; none if it was not taken here.
    pub(super) fn operator(&self) -> Option<&[f64]> {
        let operator = || operator_of(&self.problems);
        self.is_last
            .then(|| &self.operator.get_or_init(operator)[..])
    }

    /// The problems of the last step taken here, and its block.
    pub(super) fn last(&self) -> Option<(&RoverBlock<f64>, &[ContactProblem])> {
        let block = self.block.as_deref().filter(|_| self.is_last)?;
        Some((block, &self.problems))
    }
}

/// Solves a rover's problems.
pub(super) fn solve(
    queue: &mut Queue<f64>,
    problems: &mut [ContactProblem],
    options: &SolverOptions,
) {
    queue.begin(1, problems.len());
    queue.enter(0, problems, |_| true);
    while queue.next_group(problems, options).is_some() {}
}

/// The operator of all contacts of several problems, row-major, 1/kg.
fn operator_of(problems: &[ContactProblem]) -> Vec<f64> {
    let n: usize = problems.iter().map(ContactProblem::n_unknowns).sum();
    let mut operator = vec![0.0; n * n];
    let mut first = 0;
    for problem in problems {
        let own = problem.n_unknowns();
        for i in 0..own {
            for j in 0..own {
                operator[(first + i) * n + first + j] = problem.entry(i, j);
            }
        }
        first += own;
    }
    operator
}
