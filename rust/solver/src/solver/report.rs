//! The report of a solve.

use super::options::Method;
use crate::problem::Residual;

/// Why a solve, or one of its stages, stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SolveStatus {
    /// Both tolerances hold, or the violation is within the rounding of the data.
    Converged,
    /// The tolerances do not hold, but the violation is at most the
    /// [acceptable](super::SolverOptions::acceptable) one, and progress was slow.
    Acceptable,
    /// The tolerances hold for the convex relaxation, which is not Coulomb's law; the report's
    /// residuals are those of Coulomb's law.
    SolvedRelaxed,
    /// The allowed iterations were used up.
    MaxIterations,
    /// Progress stopped before the tolerance.
    #[default]
    Stalled,
    /// The [`budget`](super::SolverOptions::budget) of work was spent.
    BudgetExhausted,
    /// The data are not finite, or overflow; the returned `p` and `u` are zero.
    NonFinite,
}

impl SolveStatus {
    /// Public name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Acceptable => "acceptable",
            Self::SolvedRelaxed => "relaxed",
            Self::MaxIterations => "max_iterations",
            Self::Stalled => "stalled",
            Self::BudgetExhausted => "budget_exhausted",
            Self::NonFinite => "non_finite",
        }
    }
}

/// One stage of a solve. [`Method::Auto`] tries one after the other until an answer meets the
/// tolerances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// `q = 0`: nothing to do.
    #[default]
    AtRest,
    /// Gauss–Seidel sweeps.
    Sweeps,
    /// Accelerated sweeps on the velocities of free bodies.
    BodySweeps,
    /// Islands of contacts that share no body, each solved separately.
    Islands,
    /// From the warm start: pivoting, in which one contact at a time changes its mode.
    Pivoting,
    /// From zero impulse: Newton's steps on the modes that a few sweeps find.
    GuidedNewton,
    /// Full Newton steps on predicted modes, from zero or from the result of the sweeps.
    Newton,
    /// Few contacts: Lemke's pivoting on friction pyramids, then pivoting.
    Pyramids,
    /// Proximal point around a damped Newton.
    ProximalPoint,
    /// Few contacts: pivoting from the nearest answer so far and from other starts.
    Restarts,
    /// Interior point.
    InteriorPoint,
    /// Alternating directions.
    Admm,
    /// Alternating directions on the convex relaxation.
    Relaxed,
}

impl Stage {
    /// Public name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::AtRest => "at_rest",
            Self::Sweeps => "sweeps",
            Self::BodySweeps => "body_sweeps",
            Self::Islands => "islands",
            Self::Pivoting => "pivoting",
            Self::GuidedNewton => "guided_newton",
            Self::Newton => "newton",
            Self::Pyramids => "pyramids",
            Self::ProximalPoint => "proximal",
            Self::Restarts => "restarts",
            Self::InteriorPoint => "interior_point",
            Self::Admm => "admm",
            Self::Relaxed => "relaxed",
        }
    }

    /// The method that the stage belongs to; for islands, the method of the hardest one.
    #[must_use]
    pub const fn method(self) -> Method {
        match self {
            Self::Sweeps | Self::BodySweeps | Self::Islands => Method::GaussSeidel,
            Self::AtRest
            | Self::Pivoting
            | Self::GuidedNewton
            | Self::Newton
            | Self::Pyramids
            | Self::Restarts => Method::Newton,
            Self::ProximalPoint | Self::InteriorPoint => Method::ProximalPoint,
            Self::Admm => Method::Admm,
            Self::Relaxed => Method::Relaxed,
        }
    }
}

/// The result that the stages hand over for judgement.
#[derive(Clone, Copy, Debug)]
pub(super) struct StageResult {
    /// The method that gave the answer.
    pub method: Method,
    /// The stage that gave the answer.
    pub stage: Stage,
    /// Why the stage stopped.
    pub status: SolveStatus,
    /// Residual of the answer under Coulomb's law.
    pub residual: Residual,
}

/// A stage that was tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rung {
    /// Which one.
    pub stage: Stage,
    /// Why it ended.
    pub status: SolveStatus,
    /// Sweeps and linear solves of the stage. 32 bits, since every step copies the list.
    pub iterations: u32,
    /// Matrices factored for the linear solves; islands and sweeps over bodies count none.
    pub factorisations: u32,
}

/// The stages that were tried, in their order.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Rungs {
    list: [Rung; Self::MOST],
    len: usize,
}

impl Rung {
    /// Number of iterations as a `u32`, saturated.
    pub(super) fn count(iterations: usize) -> u32 {
        u32::try_from(iterations).unwrap_or(u32::MAX)
    }
}

impl Rungs {
    /// Most stages of one solve; later ones would not be listed.
    const MOST: usize = 16;

    /// Adds a stage.
    #[inline]
    pub(super) fn push(&mut self, rung: Rung) {
        if let Some(place) = self.list.get_mut(self.len) {
            *place = rung;
            self.len += 1;
        }
    }

    /// Marks the last stage's answer as not accepted.
    pub(super) fn amend(&mut self, status: SolveStatus) {
        if let Some(last) = self.list[..self.len].last_mut() {
            last.status = status;
        }
    }

    /// The list.
    #[must_use]
    pub fn as_slice(&self) -> &[Rung] {
        &self.list[..self.len]
    }
}

impl std::fmt::Debug for Rungs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.as_slice()).finish()
    }
}

/// Report of a solve, computed from the returned impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Reason for the end of the solve.
    pub status: SolveStatus,
    /// Sweeps and linear solves together.
    pub iterations: usize,
    /// Work done, in the unit of [`budget`](super::SolverOptions::budget).
    pub work: u64,
    /// Violation of the law relative to the data, dimensionless, see [`Residual`].
    pub residual: f64,
    /// Largest violation at one contact, m/s.
    pub velocity_error: f64,
    /// The method that produced the answer; never [`Method::Auto`].
    pub method: Method,
    /// The stage that produced the answer.
    pub stage: Stage,
    /// Every stage that was tried.
    pub rungs: Rungs,
}

impl SolveReport {
    /// Replaces the reason that the last stage gave for its end.
    pub(super) fn amend(&mut self, status: SolveStatus) {
        self.status = status;
        self.rungs.amend(status);
    }

    /// Matrices factored by all stages together.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        let rungs = self.rungs.as_slice().iter();
        rungs.map(|rung| rung.factorisations as usize).sum()
    }

    /// Systems solved while pivoting: one contact changes its mode between two of them.
    #[must_use]
    pub fn pivots(&self) -> usize {
        let rungs = self.rungs.as_slice().iter();
        let pivoting = rungs.filter(|rung| rung.stage == Stage::Pivoting);
        pivoting.map(|rung| rung.iterations as usize).sum()
    }

    /// Whether the answer meets the tolerances, or is acceptable.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        matches!(
            self.status,
            SolveStatus::Converged | SolveStatus::Acceptable
        )
    }
}
