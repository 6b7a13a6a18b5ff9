//! A solve on its way, and the memory that its stages share, kept between solves so that none of
//! them allocates.

use super::history::History;
use super::linear::lemke::Tableau;
use super::linear::reduced_system::ReducedSystem;
use super::local::sweep;
use super::options::SolverOptions;
use super::pivoting::{Many, Pivoting};
use super::report::{Rung, Rungs, SolveStatus, Stage};
use super::work::{self, WorkBudget};
use crate::problem::{Operator, Prepared, Residual};

/// Impulses and velocities of the iterations (n each), the Newton system,
/// and the record of the stages.
#[derive(Clone, Debug, Default)]
pub(super) struct SolveScratch {
    /// The linear system of a Newton step with its linearisation.
    pub system: ReducedSystem,
    /// Pivoting's impulses, velocities and modes.
    pub pivoting: Pivoting<f64, Many>,
    /// Friction pyramids in the place of the cones.
    pub pyramids: PyramidScratch,
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
}

/// Where the edges of a contact's pyramid are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fan {
    /// Direction of the first one.
    pub first: [f64; 2],
    /// Angle between it and those beside it, rad; at most that of a regular pyramid.
    pub angle: f64,
}

/// Pyramids in the place of few contacts' cones.
#[derive(Clone, Debug, Default)]
pub(super) struct PyramidScratch {
    pub tableau: Tableau,
    /// Where the edges of each are.
    pub fans: Vec<Fan>,
    /// Normal and edges of each, in the frames of the contacts.
    pub edges: Vec<[f64; 3]>,
    /// The Delassus operator, n by n.
    pub W: Vec<f64>,
}

/// Why a stage ended, and the residual of its answer.
pub(super) type StageEnd = (SolveStatus, Residual);

/// A solve on its way: the problem, the impulse that the stages improve, and what they share.
#[derive(Debug)]
pub(super) struct Attempt<'a, const D: usize> {
    pub data: &'a Prepared<'a>,
    pub options: &'a SolverOptions,
    /// Impulse (n), N s.
    pub p: &'a mut [f64],
    /// Velocity `W p + q` (n), m/s, when a stage ends.
    pub u: &'a mut [f64],
    pub scratch: &'a mut SolveScratch,
    /// Sweeps and linear solves so far.
    pub iterations: usize,
}

impl<const D: usize> Attempt<'_, D> {
    /// `u = W p + q`.
    #[inline]
    pub fn find_velocity(&mut self) {
        self.data.W.multiply_add(self.p, self.data.q, self.u);
    }

    /// Residual of the impulse and its velocity.
    #[inline]
    pub fn residual(&self) -> Residual {
        self.data.measure::<D>(self.p, self.u)
    }

    /// Residual of the impulse and its velocity, which enters the history.
    #[inline]
    pub fn measure(&mut self) -> Residual {
        let residual = self.residual();
        self.scratch.history.note(self.iterations, residual);
        residual
    }

    /// Whether no impulse does better, because of rounding.
    #[inline]
    pub fn is_within_rounding(&self) -> bool {
        self.data.is_within_rounding::<D>(self.p, self.u)
    }

    /// Keeps the impulse if it is better than the best one of the stage so far.
    #[inline]
    pub fn keep_if_better(&mut self, residual: Residual, best: &mut Residual) {
        if residual.relative < best.relative {
            *best = residual;
            self.scratch.best.copy_from_slice(self.p);
        }
    }

    /// Goes back to the best impulse of the stage.
    #[inline]
    pub fn take_best(&mut self) {
        self.p.copy_from_slice(&self.scratch.best);
        self.find_velocity();
    }

    /// Spends the work of a few products with `W` and of sweeps; false if the budget does not allow
    /// it.
    #[inline]
    pub fn affords_sweeps(&mut self, products: u64, sweeps: usize) -> bool {
        let product = self.data.product;
        let sweep = work::sweep(product, self.data.mu.len());
        let work = &mut self.scratch.work;
        work.affords(products * product + sweeps as u64 * sweep)
    }

    /// Sweeps over the regularised problem; false if the budget does not allow it.
    pub fn sweep(&mut self, alpha: f64, sweeps: usize) -> bool {
        if !self.affords_sweeps(0, sweeps) {
            return false;
        }
        let prox = self.scratch.system.prox(alpha);
        for _ in 0..sweeps {
            sweep::sweep::<D>(self.data, prox, self.p);
        }
        true
    }
}
