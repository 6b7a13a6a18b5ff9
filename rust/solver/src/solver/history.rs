//! The residuals that a solve measured on its way, kept on request.

use super::report::Stage;
use crate::problem::Residual;

/// An iterate whose residual was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterate {
    /// The stage that it belongs to.
    pub stage: Stage,
    /// Sweeps and linear solves of all stages before it.
    pub iterations: usize,
    /// [Relative residual](Residual::relative) of the iterate; in [`Stage::Relaxed`] that of the
    /// convex relaxation.
    pub residual: f64,
}

/// The measured iterates of a solve, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    is_kept: bool,
    list: Vec<Iterate>,
    /// Iterates of the stages that have ended.
    ended: usize,
}

impl History {
    /// Begins anew, for a solve that keeps its iterates or does not.
    pub fn begin(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
        self.list.clear();
        self.ended = 0;
    }

    /// Enters an iterate of the current stage.
    #[inline]
    pub fn note(&mut self, iterations: usize, residual: Residual) {
        if self.is_kept {
            self.list.push(Iterate {
                stage: Stage::default(),
                iterations,
                residual: residual.relative,
            });
        }
    }

    /// Names the stage that has ended.
    #[inline]
    pub fn end_stage(&mut self, stage: Stage) {
        for iterate in &mut self.list[self.ended..] {
            iterate.stage = stage;
        }
        self.ended = self.list.len();
    }

    /// The iterates.
    pub fn as_slice(&self) -> &[Iterate] {
        &self.list
    }
}
