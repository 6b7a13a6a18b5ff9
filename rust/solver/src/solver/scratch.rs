//! Memory that the stages of a solve share, kept between solves so that none of them allocates.

use super::history::History;
use super::linear::reduced_system::ReducedSystem;
use super::pivoting::{Many, Pivoting};
use super::report::{Rung, Rungs, SolveStatus, Stage};
use super::work::{WorkBudget, sweep};
use crate::problem::Operator;

/// Impulses and velocities of the iterations (n each), the Newton system,
/// and the record of the stages.
#[derive(Clone, Debug, Default)]
pub(super) struct SolveScratch {
    /// The linear system of a Newton step with its linearisation.
    pub system: ReducedSystem,
    /// Pivoting's impulses, velocities and modes.
    pub pivoting: Pivoting<f64, Many>,
    /// Inverse masses of the contacts, 1/kg: ADMM's penalty at `σ = 1`.
    pub weights: Vec<f64>,
    /// Impulse at the start of the solve, N s.
    pub start: Vec<f64>,
    /// Best impulse of the current stage, N s.
    pub best: Vec<f64>,
    /// Nearest answer of all stages so far, N s.
    pub nearest: Vec<f64>,
    /// Last impulse that solved a proximal step, N s.
    pub accepted: Vec<f64>,
    /// Direction of a damped step, N s, and its image under `W`, m/s.
    pub direction: Vec<f64>,
    pub image: Vec<f64>,
    /// Work done and allowed.
    pub work: WorkBudget,
    /// Stages tried.
    pub rungs: Rungs,
    /// Residuals measured.
    pub history: History,
}

impl SolveScratch {
    /// Makes every buffer fit; the contents are unspecified.
    pub fn fit(&mut self, n_contacts: usize, n: usize, W: Operator<'_>) {
        if self.start.len() != n || self.weights.len() != n_contacts {
            self.resize(n_contacts, n);
        }
        self.system.fit(n, W);
    }

    /// Makes room for `n` unknowns of `n_contacts` contacts.
    pub fn resize(&mut self, n_contacts: usize, n: usize) {
        self.weights.resize(n_contacts, 0.0);
        self.system.resize(n_contacts, n);
        self.pivoting.resize(n_contacts);
        for buffer in [
            &mut self.start,
            &mut self.best,
            &mut self.nearest,
            &mut self.accepted,
            &mut self.direction,
            &mut self.image,
        ] {
            buffer.resize(n, 0.0);
        }
    }

    /// Records a stage that ended and its reason, which is the budget if the stage could not finish
    /// for lack of it.
    #[inline]
    pub fn list_stage(
        &mut self,
        stage: Stage,
        status: SolveStatus,
        iterations: usize,
    ) -> SolveStatus {
        let status = match status {
            SolveStatus::MaxIterations | SolveStatus::Stalled if self.work.is_exhausted => {
                SolveStatus::BudgetExhausted
            }
            status => status,
        };
        self.history.end_stage(stage);
        self.rungs.push(Rung {
            stage,
            status,
            iterations: Rung::count(iterations),
            factorisations: std::mem::take(&mut self.work.factorisations),
        });
        status
    }

    /// Spends the work of a product and this many sweeps; false if the budget does not allow it.
    #[inline]
    pub fn affords_sweeps(&mut self, product: u64, n_contacts: usize, sweeps: usize) -> bool {
        self.work
            .affords(product + sweeps as u64 * sweep(product, n_contacts))
    }
}
