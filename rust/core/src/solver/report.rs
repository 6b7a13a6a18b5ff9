//! How a solve ended.

use super::Method;

/// Why a solve stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SolveStatus {
    /// Both tolerances hold, or the violation is within the rounding of the data.
    Converged,
    /// The tolerances hold for the convex relaxation, which is not the law that was asked for; the report's numbers are Coulomb's.
    SolvedRelaxed,
    /// The allowed iterations were used up.
    MaxIterations,
    /// Progress stopped before the tolerance.
    Stalled,
    /// The data are not finite, or overflow; the returned `p` and `u` are zero.
    NonFinite,
}

/// How a solve ended, judged from the returned impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Why the solve stopped.
    pub status: SolveStatus,
    /// Sweeps and linear solves together.
    pub iterations: usize,
    /// Natural map relative to the data, dimensionless, see [`Residual`](crate::problem::Residual).
    pub residual: f64,
    /// Largest violation at one contact, m/s.
    pub velocity_error: f64,
    /// The method that produced the answer; never [`Method::Auto`].
    pub method: Method,
}

impl SolveReport {
    /// Whether the answer meets the tolerances.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == SolveStatus::Converged
    }
}
