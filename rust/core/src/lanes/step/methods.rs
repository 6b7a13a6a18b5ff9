//! Solver methods other than that of the lanes: they take the problems one after the other.

use super::Block;
use crate::scalar::{Lane, LaneMask};
use crate::solver::Method;
use crate::solver::batch::problem::ContactProblem;

impl<T: Lane> Block<T> {
    /// Whether a queue solves the problems; otherwise the block does.
    #[must_use]
    pub fn needs_queue(&self) -> bool {
        self.options.solver.method == Method::Auto
    }

    /// Notes that the problems of some lanes have no answer yet.
    pub(super) fn await_answers(&self, problems: &mut [ContactProblem], lanes: T::Mask) {
        if self.needs_queue() {
            return;
        }
        for (index, problem) in problems[..self.n_problems()].iter_mut().enumerate() {
            problem.is_solved &= !lanes.get(Self::lane_of(index));
        }
    }

    /// Solves the problems without an answer by the method of the options.
    pub(super) fn solve_by_method(&mut self, problems: &mut [ContactProblem]) {
        if self.needs_queue() {
            return;
        }
        let own = self.by_method.get_or_insert_default();
        for (index, problem) in problems[..self.contacts.n_problems()]
            .iter_mut()
            .enumerate()
        {
            let is_going = self.going.get(Self::lane_of(index));
            if is_going && problem.n_contacts > 0 && !problem.is_solved {
                own.solve(problem, &self.options.solver);
            }
        }
    }
}
