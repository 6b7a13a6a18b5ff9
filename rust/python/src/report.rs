//! What a call of `step` and a question for the energy come back with.

use pyo3::prelude::*;
use rover_core::integrator::StepReport as CoreReport;
use rover_core::multibody::Energy as CoreEnergy;

/// How the steps of one call went: the worst of them, or their sum.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct StepReport {
    inner: CoreReport,
    undetermined_loads: usize,
}

#[pymethods]
impl StepReport {
    /// Whether the steps "converged" or "not_converged".
    ///
    /// "converged" means that the contact solver met its tolerance in every step.
    #[getter]
    fn status(&self) -> &'static str {
        if self.inner.is_converged() {
            "converged"
        } else {
            "not_converged"
        }
    }

    /// Whether the contact solver met its tolerance in every step.
    #[getter]
    fn is_converged(&self) -> bool {
        self.inner.is_converged()
    }

    /// Whether a contact problem stayed unsolved because the solver's `budget` was spent.
    ///
    /// With a larger `budget` it may be solved.
    #[getter]
    fn budget_exhausted(&self) -> bool {
        self.inner.budget_exhausted
    }

    /// Number of steps taken.
    #[getter]
    fn steps(&self) -> usize {
        self.inner.steps
    }

    /// Iterations of the contact solver, summed over the steps.
    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    /// Newton iterations of the scheme, summed over the steps; 0 with the linearised scheme.
    #[getter]
    fn newton_iterations(&self) -> usize {
        self.inner.newton_iterations
    }

    /// Largest relative residual of a step's contact problem, computed from its impulses.
    ///
    /// Where the energy audit slowed a rebound (`restitution` above 0), it contains how far the
    /// rebound then falls short of Newton's law. The status is the solver's.
    #[getter]
    fn residual(&self) -> f64 {
        self.inner.residual
    }

    /// Largest number of contacts in a step.
    #[getter]
    fn n_contacts(&self) -> usize {
        self.inner.n_contacts
    }

    /// Number of steps taken again.
    ///
    /// A step is taken again when a motor reached its torque-speed line, when the energy audit asks
    /// for implicit gyroscopic terms, or when Newton's law of restitution had no solution.
    #[getter]
    fn retaken(&self) -> usize {
        self.inner.retaken
    }

    /// Steps that the general step took, since the fast one does not take them.
    ///
    /// 0 of machines in the plane and of grains, which have no fast one.
    /// `Simulation.fallback_reason` says whether a simulation has fast steps.
    #[getter]
    fn fallbacks(&self) -> usize {
        self.inner.fallbacks
    }

    /// Largest unexplained gain of energy in a step, relative to the kinetic energy.
    ///
    /// Unexplained is what exceeds the work of gravity and actuators.
    #[getter]
    fn energy_gain(&self) -> f64 {
        self.inner.energy_gain
    }

    /// Energy that the scheme would have gained and the audit removed, summed over the steps, J.
    #[getter]
    fn energy_removed(&self) -> f64 {
        self.inner.energy_removed
    }

    /// Energy that friction and impacts took by their law, summed over the steps, J.
    ///
    /// Newton's law of restitution with friction can make it negative. A new contact that closes
    /// faster than gravity explains counts as an impact.
    #[getter]
    fn energy_dissipated(&self) -> f64 {
        self.inner.energy_dissipated
    }

    /// Energy that the scheme lost, summed over the steps, J; negative where it gained.
    ///
    /// The change of the energy is the work of the actuators minus `energy_dissipated`,
    /// `energy_lost` and `energy_removed`, plus `energy_lifted` and `energy_released`.
    /// `energy_lost` is therefore what no law explains: errors of the time step, and the work of
    /// reactions in contacts that persist. In smooth motion it shrinks with the square of the step.
    /// Always 0 with grains and planar soils, whose energy is not audited.
    #[getter]
    fn energy_lost(&self) -> f64 {
        self.inner.energy_lost
    }

    /// Energy gained by pushing bodies out of penetration, less the actuators' work, all steps, J.
    #[getter]
    fn energy_lifted(&self) -> f64 {
        self.inner.energy_lifted
    }

    /// Energy released by yielding wheels, summed over the steps, J; negative where they stored it.
    ///
    /// Wheels yield where their model gives them a `stiffness`. Their springs are part of neither
    /// the kinetic nor the potential energy. Besides what the springs give off, it holds the work
    /// that the wheel's force does because it is constant over a step, which cancels where a wheel
    /// comes to rest again.
    #[getter]
    fn energy_released(&self) -> f64 {
        self.inner.energy_released
    }

    /// Number of independent sets of wheel loads that balance one another in the last step.
    ///
    /// 0 means that equilibrium determines the loads. Otherwise they are one of many answers, and
    /// micrometres decide which: a rigid chassis on four rigid wheels has one such set. Wheels with
    /// a `stiffness` have none. Friction is not considered; 0 for other machines than rovers.
    #[getter]
    fn undetermined_loads(&self) -> usize {
        self.undetermined_loads
    }

    /// The report of these steps and of further ones.
    ///
    /// Args:
    ///     later: How the further ones went.
    fn followed_by(&self, later: &Self) -> Self {
        let mut inner = self.inner;
        inner.merge(&later.inner);
        Self {
            inner,
            undetermined_loads: later.undetermined_loads,
        }
    }

    fn __repr__(&self) -> String {
        let r = &self.inner;
        format!(
            "StepReport(status={:?}, steps={}, iterations={}, residual={:.3e}, n_contacts={})",
            self.status(),
            r.steps,
            r.iterations,
            r.residual,
            r.n_contacts
        )
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

/// Kinetic and potential energy.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Energy {
    inner: CoreEnergy,
}

#[pymethods]
impl Energy {
    /// Kinetic energy, J.
    #[getter]
    fn kinetic(&self) -> f64 {
        self.inner.kinetic
    }

    /// Potential energy in gravity, J, zero at the world's origin.
    #[getter]
    fn potential(&self) -> f64 {
        self.inner.potential
    }

    /// Sum of both, J.
    #[getter]
    fn total(&self) -> f64 {
        self.inner.total()
    }

    fn __repr__(&self) -> String {
        format!(
            "Energy(kinetic={}, potential={})",
            self.inner.kinetic, self.inner.potential
        )
    }
}

impl From<CoreReport> for StepReport {
    fn from(inner: CoreReport) -> Self {
        Self {
            inner,
            undetermined_loads: 0,
        }
    }
}

impl From<CoreEnergy> for Energy {
    fn from(inner: CoreEnergy) -> Self {
        Self { inner }
    }
}
