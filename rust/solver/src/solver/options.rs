//! Options of a solve.

use crate::problem::Residual;

/// The contact law that an answer obeys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ContactLaw {
    /// Signorini's condition with Coulomb's friction, `K* ∋ u + μ|u_T| n ⊥ p ∈ K`.
    Coulomb,
    /// The convex relaxation `K* ∋ u ⊥ p ∈ K`: a sliding contact parts with `μ|u_T|`.
    Relaxed,
}

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
    /// Alternating directions (ADMM), with De Saxcé's shift renewed at every iteration; `Auto` uses
    /// a few iterations to bring many contacts close to the answer.
    Admm,
    /// The convex relaxation of Coulomb's law, for comparison: its answer
    /// obeys another law and never counts as converged.
    Relaxed,
}

impl Method {
    /// All methods, the default first.
    pub const ALL: [Self; 6] = [
        Self::Auto,
        Self::GaussSeidel,
        Self::Newton,
        Self::ProximalPoint,
        Self::Admm,
        Self::Relaxed,
    ];

    /// Public name, as Python and reports use it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::GaussSeidel => "nsgs",
            Self::Newton => "newton",
            Self::ProximalPoint => "proximal",
            Self::Admm => "admm",
            Self::Relaxed => "relaxed",
        }
    }

    /// The method with this public name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// The law that its answers satisfy.
    #[must_use]
    pub const fn law(self) -> ContactLaw {
        match self {
            Self::Relaxed => ContactLaw::Relaxed,
            _ => ContactLaw::Coulomb,
        }
    }
}

/// Options of [`solve`](crate::solver::solve).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Which algorithm; default [`Method::Auto`].
    pub method: Method,
    /// Largest [relative residual](crate::problem::Residual::relative) of a
    /// converged answer, dimensionless; default 1e-12.
    ///
    /// An answer whose violation is within the rounding of `W p + q` also counts as converged,
    /// since no impulse does better.
    pub tolerance: f64,
    /// Largest violation of a converged answer at any contact, m/s; default 1e-9.
    pub velocity_tolerance: f64,
    /// Violation at any contact, m/s, of an answer that is accepted where progress is slow; default
    /// 0, which accepts none. [`Method::Auto`] with few contacts asks for it once its quick stages
    /// have missed the tolerances: contacts that are wedged against each other may have no answer
    /// in floating point that is better by much.
    pub acceptable: f64,
    /// Whether [`Method::Auto`] with few contacts leaves out pivoting from `p`, which has been
    /// tried in a batch; default false.
    pub is_pivoted: bool,
    /// Whether [`Method::Auto`] with few contacts leaves out its last resorts, pivoting from random
    /// starts and the proximal point method, because the caller has another way; default false.
    pub is_brief: bool,
    /// Rounding of the free velocity q, m/s; default 0. Bodies that move together have a q that is
    /// the difference of larger velocities, known to the rounding of these.
    ///
    /// Where a stage of [`Method::Auto`] misses the tolerances, an answer whose violation is at
    /// most this at any contact counts as converged.
    pub rounding: f64,
    /// Most Newton steps of a stage, counting every linear solve; default 500.
    pub max_newton_steps: usize,
    /// Most Gauss–Seidel sweeps, or ADMM iterations, when that method is requested; default 10 000.
    /// `Auto` stops earlier by its own rules.
    pub max_sweeps: usize,
    /// Proximal regularisation `α` relative to the mean diagonal of `W`; default 1e-6.
    ///
    /// Measured: smaller values amplify rounding (`ε/α`) in the null space of `W`; larger ones cost
    /// refinement steps.
    pub regularisation: f64,
    /// Most work of a solve; default `None`, which grows with the problem
    /// ([`usual_budget`](Self::usual_budget)). Work is counted, not timed, so that equal problems
    /// end alike on every machine.
    ///
    /// The unit is one multiply–add in a product with `W`. When the budget is spent, the solve
    /// stops with [`SolveStatus::BudgetExhausted`](super::SolveStatus::BudgetExhausted) and returns
    /// the best impulse known by then.
    pub budget: Option<u64>,
    /// Most contacts for which `Auto` starts with Newton, without Gauss–Seidel first; default 32.
    pub direct_contacts: usize,
    /// Whether the workspace keeps the residuals [measured](super::SolverWorkspace::history) on the
    /// way; default false.
    pub keeps_history: bool,
    /// Threads for sweeps over thousands of balls, the only solver that uses any; default 1. The
    /// answer does not depend on them.
    pub threads: usize,
}

impl SolverOptions {
    /// Work allowed by default: 3e8, about 0.3 s on a processor of 2024, for up to 64 contacts,
    /// 1.2e9 for up to 200, and more in proportion to the square of the contacts beyond, as a
    /// sparse factorisation of a pile takes more. Of 22 400 steps in which heaps of 27 and 64 boxes
    /// pile up, 3e8 for up to 100 contacts leaves six unsolved, 1.2e9 none.
    #[must_use]
    pub fn usual_budget(n_contacts: usize) -> u64 {
        const FEW: usize = 64;
        const OF_FEW: u64 = 300_000_000;
        const OF_A_HEAP: u64 = 1_200_000_000;
        const PER_PAIR: u64 = 30_000;
        if n_contacts <= FEW {
            return OF_FEW;
        }
        let n = n_contacts as u64;
        n.saturating_mul(n).saturating_mul(PER_PAIR).max(OF_A_HEAP)
    }

    /// Most work of a solve of this many contacts.
    #[must_use]
    pub fn budget_of(&self, n_contacts: usize) -> u64 {
        self.budget
            .unwrap_or_else(|| Self::usual_budget(n_contacts))
    }

    /// Whether both tolerances hold.
    #[inline]
    pub(super) fn accepts(&self, residual: Residual) -> bool {
        residual.relative <= self.tolerance && residual.velocity <= self.velocity_tolerance
    }

    /// Whether the violation is within the rounding of the data.
    pub(super) fn is_rounding(&self, residual: Residual) -> bool {
        residual.velocity <= self.rounding
    }

    /// Whether the answer may be accepted where progress is slow.
    pub(super) fn is_acceptable(&self, residual: Residual) -> bool {
        residual.velocity <= self.acceptable
    }

    /// Factor by which a residual exceeds the tolerances.
    pub(super) fn excess(&self, residual: Residual) -> f64 {
        (residual.relative / self.tolerance).max(residual.velocity / self.velocity_tolerance)
    }
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            tolerance: 1e-12,
            velocity_tolerance: 1e-9,
            acceptable: 0.0,
            is_pivoted: false,
            is_brief: false,
            rounding: 0.0,
            max_newton_steps: 500,
            max_sweeps: 10_000,
            regularisation: 1e-6,
            budget: None,
            direct_contacts: 32,
            keeps_history: false,
            threads: 1,
        }
    }
}
