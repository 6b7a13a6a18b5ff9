//! Scratch memory of a solve, kept between solves so that none of them allocates.

use super::block_lu::BlockLu;
use super::dense::{self, Chunk, LANES};
use super::islands::Islands;
use super::modes::Linearised;
use super::report::Rungs;
use super::stage::body_sweeps::BodySweeps;
use super::storage::Storage;
use super::work::Work;
use crate::problem::Operator;

/// Scratch of [`solve`](crate::solver::solve): grows to the largest problem met, carries nothing from one solve to the next.
///
/// Up to [`direct_contacts`](crate::solver::SolverOptions::direct_contacts) a solve in a sized workspace allocates nothing; above, the pattern of the sparse
/// factors is made anew where Gauss–Seidel does not answer.
#[derive(Clone, Debug, Default)]
pub struct SolverWorkspace {
    /// Scale of each contact in the residual, kg.
    pub(super) rho: Vec<f64>,
    /// Inverse of the scales, 1/kg: ADMM's penalty at `σ = 1`.
    pub(super) weights: Vec<f64>,
    /// Scales of the mode prediction, normal and tangential, kg.
    pub(super) rho_modes: Vec<[f64; 2]>,
    /// Mode and frame of each contact in the current linearisation.
    pub(super) contacts: Vec<Linearised>,
    /// Proximal centre, N s.
    pub(super) centre: Vec<f64>,
    /// Impulse that the solve started from, N s.
    pub(super) start: Vec<f64>,
    /// Best impulse so far, N s.
    pub(super) best: Vec<f64>,
    /// Last impulse that solved a proximal step, N s.
    pub(super) accepted: Vec<f64>,
    /// Direction of a damped step, N s, and its image under `W`.
    pub(super) direction: Vec<f64>,
    pub(super) image: Vec<f64>,
    /// Trial point of a damped step.
    pub(super) trial: Vec<f64>,
    pub(super) trial_velocity: Vec<f64>,
    /// Right-hand side and solution of the linear system.
    pub(super) rhs: Vec<Chunk>,
    /// Matrix of the linear system, factored in place.
    pub(super) matrix: Vec<Chunk>,
    /// Row exchanges of the factorisation.
    pub(super) pivots: Vec<usize>,
    /// Factors of the block-sparse system, and whether its pattern is that of the present problem.
    pub(super) block_lu: BlockLu,
    pub(super) is_analysed: bool,
    /// Work done and allowed.
    pub(super) work: Work,
    /// Stages tried.
    pub(super) rungs: Rungs,
    /// Nearest answer of the stages so far, N s.
    pub(super) nearest: Vec<f64>,
    /// `W` in the storage that suits its size.
    pub(super) storage: Storage,
    /// Of the sweeps over pairs of bodies.
    pub(crate) body_sweeps: BodySweeps,
    /// Problems of the islands.
    pub(super) islands: Option<Box<Islands>>,
}

impl SolverWorkspace {
    /// Empty scratch; it sizes itself at the first solve.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Scratch for problems of up to `n_contacts` contacts of `components` components, so that no solve allocates.
    #[must_use]
    pub fn with_capacity(n_contacts: usize, components: usize) -> Self {
        let mut workspace = Self::default();
        let n = n_contacts * components;
        workspace.resize(n_contacts, n);
        workspace.resize_dense(n);
        workspace
    }

    /// Makes every buffer fit; the contents are unspecified.
    pub(super) fn fit(&mut self, n_contacts: usize, n: usize, W: Operator<'_>) {
        if self.trial.len() != n || self.rho.len() != n_contacts {
            self.resize(n_contacts, n);
        }
        match W {
            Operator::Dense(_) => {
                if self.pivots.len() != LANES * dense::chunks(n) {
                    self.resize_dense(n);
                }
            }
            Operator::BlockSparse(_) => self.is_analysed = false,
        }
    }

    fn resize_dense(&mut self, n: usize) {
        let size = dense::chunks(n);
        self.matrix.resize(LANES * size * size, [0.0; LANES]);
        self.pivots.resize(LANES * size, 0);
    }

    fn resize(&mut self, n_contacts: usize, n: usize) {
        self.rho.resize(n_contacts, 0.0);
        self.weights.resize(n_contacts, 0.0);
        self.rho_modes.resize(n_contacts, [0.0; 2]);
        self.contacts.resize(n_contacts, Linearised::default());
        self.rhs.resize(dense::chunks(n), [0.0; LANES]);
        for buffer in [
            &mut self.centre,
            &mut self.start,
            &mut self.best,
            &mut self.nearest,
            &mut self.accepted,
            &mut self.direction,
            &mut self.image,
            &mut self.trial,
            &mut self.trial_velocity,
        ] {
            buffer.resize(n, 0.0);
        }
    }
}
