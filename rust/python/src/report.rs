//! What a call of `step` and a question for the energy come back with.

use pyo3::prelude::*;
use rover_core::integrator::StepReport as CoreReport;
use rover_core::multibody::Energy as CoreEnergy;

/// How the steps of one call went: the worst of them, or their sum.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct StepReport {
    inner: CoreReport,
    /// Whether the steps "converged" or "not_converged".
    ///
    /// "converged" means that the contact solver met its tolerance in every step.
    #[pyo3(get)]
    status: &'static str,
    /// Whether the contact solver met its tolerance in every step.
    #[pyo3(get)]
    is_converged: bool,
    /// Whether a contact problem stayed unsolved because the solver's `budget` was spent.
    ///
    /// With a larger `budget` it may be solved.
    #[pyo3(get)]
    budget_exhausted: bool,
    /// Number of steps taken.
    #[pyo3(get)]
    steps: usize,
    /// Iterations of the contact solver, summed over the steps.
    #[pyo3(get)]
    iterations: usize,
    /// Newton iterations of the scheme, summed over the steps; 0 with the linearised scheme.
    #[pyo3(get)]
    newton_iterations: usize,
    /// Largest relative residual of a step's contact problem, computed from its impulses.
    ///
    /// Where the energy audit slowed a rebound (`restitution` above 0), it contains how far the
    /// rebound then falls short of Newton's law. The status is the solver's.
    #[pyo3(get)]
    residual: f64,
    /// Largest number of contacts in a step.
    #[pyo3(get)]
    n_contacts: usize,
    /// Number of steps taken again.
    ///
    /// A step is taken again when a motor reached its torque-speed line, when the energy audit asks
    /// for implicit gyroscopic terms, or when Newton's law of restitution had no solution.
    #[pyo3(get)]
    retaken: usize,
    /// Steps that the general step took, since the fast one does not take them.
    ///
    /// 0 of machines in the plane and of grains, which have no fast one.
    /// `Simulation.fallback_reason` says whether a simulation has fast steps.
    #[pyo3(get)]
    fallbacks: usize,
    /// Largest unexplained gain of energy in a step, relative to the kinetic energy.
    ///
    /// Unexplained is what exceeds the work of gravity and actuators.
    #[pyo3(get)]
    energy_gain: f64,
    /// Energy that the scheme would have gained and the audit removed, summed over the steps, J.
    #[pyo3(get)]
    energy_removed: f64,
    /// Energy that friction and impacts took by their law, summed over the steps, J.
    ///
    /// Newton's law of restitution with friction can make it negative. A new contact that closes
    /// faster than gravity explains counts as an impact.
    #[pyo3(get)]
    energy_dissipated: f64,
    /// Energy that the scheme lost, summed over the steps, J; negative where it gained.
    ///
    /// The change of the energy is the work of the actuators minus `energy_dissipated`,
    /// `energy_lost` and `energy_removed`, plus `energy_lifted` and `energy_released`.
    /// `energy_lost` is therefore what no law explains: errors of the time step, and the work of
    /// reactions in contacts that persist. In smooth motion it shrinks with the square of the step.
    /// Always 0 with grains and planar soils, whose energy is not audited.
    #[pyo3(get)]
    energy_lost: f64,
    /// Energy gained by pushing bodies out of penetration, less the actuators' work, all steps, J.
    #[pyo3(get)]
    energy_lifted: f64,
    /// Energy released by yielding wheels, summed over the steps, J; negative where they stored it.
    ///
    /// Wheels yield where their model gives them a `stiffness`. Their springs are part of neither
    /// the kinetic nor the potential energy. Besides what the springs give off, it holds the work
    /// that the wheel's force does because it is constant over a step, which cancels where a wheel
    /// comes to rest again.
    #[pyo3(get)]
    energy_released: f64,
    /// Number of independent sets of wheel loads that balance one another in the last step.
    ///
    /// 0 means that equilibrium determines the loads. Otherwise they are one of many answers, and
    /// micrometres decide which: a rigid chassis on four rigid wheels has one such set. Wheels with
    /// a `stiffness` have none. Friction is not considered; 0 for other machines than rovers.
    #[pyo3(get)]
    undetermined_loads: usize,
}

impl From<CoreReport> for StepReport {
    fn from(inner: CoreReport) -> Self {
        Self {
            inner,
            status: if inner.is_converged() {
                "converged"
            } else {
                "not_converged"
            },
            is_converged: inner.is_converged(),
            budget_exhausted: inner.budget_exhausted,
            steps: inner.steps,
            iterations: inner.iterations,
            newton_iterations: inner.newton_iterations,
            residual: inner.residual,
            n_contacts: inner.n_contacts,
            retaken: inner.retaken,
            fallbacks: inner.fallbacks,
            energy_gain: inner.energy_gain,
            energy_removed: inner.energy_removed,
            energy_dissipated: inner.energy_dissipated,
            energy_lost: inner.energy_lost,
            energy_lifted: inner.energy_lifted,
            energy_released: inner.energy_released,
            undetermined_loads: 0,
        }
    }
}

impl StepReport {
    /// With the number of sets of loads that equilibrium leaves open.
    #[must_use]
    pub fn with_undetermined_loads(self, undetermined_loads: usize) -> Self {
        Self {
            undetermined_loads,
            ..self
        }
    }
}

#[pymethods]
impl StepReport {
    /// The report of these steps and of further ones.
    ///
    /// Args:
    ///     later: How the further ones went.
    fn followed_by(&self, later: &Self) -> Self {
        let mut inner = self.inner;
        inner.merge(&later.inner);
        Self::from(inner).with_undetermined_loads(later.undetermined_loads)
    }

    fn __repr__(&self) -> String {
        format!(
            "StepReport(status={:?}, steps={}, iterations={}, residual={:.3e}, n_contacts={})",
            self.status, self.steps, self.iterations, self.residual, self.n_contacts
        )
    }
}

/// Kinetic and potential energy.
#[pyclass(module = "rover_gym.mechanics", frozen, get_all)]
pub struct Energy {
    /// Kinetic energy, J.
    kinetic: f64,
    /// Potential energy in gravity, J, zero at the world's origin.
    potential: f64,
    /// Sum of both, J.
    total: f64,
}

impl From<CoreEnergy> for Energy {
    fn from(inner: CoreEnergy) -> Self {
        let total = inner.total();
        Self {
            kinetic: inner.kinetic,
            potential: inner.potential,
            total,
        }
    }
}

#[pymethods]
impl Energy {
    fn __repr__(&self) -> String {
        format!(
            "Energy(kinetic={}, potential={})",
            self.kinetic, self.potential
        )
    }
}
