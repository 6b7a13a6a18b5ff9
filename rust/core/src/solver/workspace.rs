//! Scratch memory of a solve, kept between solves so that none of them allocates.

use super::modes::Linearised;
use crate::problem::FrictionContactProblem;

/// Scratch of [`solve`](crate::solver::solve): grows to the largest problem met, carries nothing from one solve to the next.
#[derive(Clone, Debug, Default)]
pub struct SolverWorkspace {
    /// Scale of each contact in the residual, kg.
    pub(super) rho: Vec<f64>,
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
    pub(super) rhs: Vec<f64>,
    /// One combined row of `W`.
    pub(super) row: Vec<f64>,
    /// Matrix of the linear system, factored in place.
    pub(super) matrix: Vec<f64>,
    /// Row exchanges of the factorisation.
    pub(super) pivots: Vec<usize>,
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
        workspace.resize(n_contacts, n_contacts * components);
        workspace
    }

    /// Makes every buffer fit; the contents are unspecified.
    pub(super) fn fit(&mut self, problem: &FrictionContactProblem<'_>) {
        if self.rhs.len() != problem.n_unknowns() || self.rho.len() != problem.n_contacts() {
            self.resize(problem.n_contacts(), problem.n_unknowns());
        }
    }

    fn resize(&mut self, n_contacts: usize, n: usize) {
        self.rho.resize(n_contacts, 0.0);
        self.rho_modes.resize(n_contacts, [0.0; 2]);
        self.contacts.resize(n_contacts, Linearised::default());
        for buffer in [
            &mut self.centre,
            &mut self.start,
            &mut self.best,
            &mut self.accepted,
            &mut self.direction,
            &mut self.image,
            &mut self.trial,
            &mut self.trial_velocity,
            &mut self.rhs,
            &mut self.row,
        ] {
            buffer.resize(n, 0.0);
        }
        self.matrix.resize(n * n, 0.0);
        self.pivots.resize(n, 0);
    }
}
