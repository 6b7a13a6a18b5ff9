//! What the caller may choose about a solve.

/// Which algorithm solves the problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Method {
    /// Chooses by size and escalates when progress stops.
    #[default]
    Auto,
    /// Nonsmooth Gauss–Seidel with exact one-contact solutions.
    GaussSeidel,
    /// Semismooth Newton on the contact modes, full steps, no safeguard beyond the regularisation.
    Newton,
    /// Proximal point outside, damped Newton inside.
    ProximalPoint,
}

/// Options of [`solve`](crate::solver::solve).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Which algorithm; default [`Method::Auto`].
    pub method: Method,
    /// Largest relative natural map of a converged answer, dimensionless; default 1e-12.
    ///
    /// An answer whose violation is within the rounding of `W p + q` counts as converged too: no impulse does better.
    pub tolerance: f64,
    /// Largest violation of a converged answer at any contact, m/s; default 1e-9.
    pub velocity_tolerance: f64,
    /// Most Newton steps, counting every linear solve; default 500.
    pub max_newton_steps: usize,
    /// Most Gauss–Seidel sweeps when that is the method asked for; default 10 000. `Auto` stops earlier by itself.
    pub max_sweeps: usize,
    /// Proximal regularisation `α` relative to the mean diagonal of `W`; default 1e-6.
    ///
    /// Measured: smaller values let rounding (`ε/α`) leak into the impulses that `W` cannot see, larger ones cost
    /// refinement steps.
    pub regularisation: f64,
    /// Most contacts that `Auto` takes to Newton without trying Gauss–Seidel first; default 32.
    pub direct_contacts: usize,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            tolerance: 1e-12,
            velocity_tolerance: 1e-9,
            max_newton_steps: 500,
            max_sweeps: 10_000,
            regularisation: 1e-6,
            direct_contacts: 32,
        }
    }
}
