//! What a call of `step` and a question for the energy come back with.

use pyo3::prelude::*;
use rover_core::integrator::StepReport as CoreReport;
use rover_core::multibody::Energy as CoreEnergy;

/// The report of a call of `step`: the fields of the core's, as properties.
macro_rules! step_report {
    ($($(#$doc:tt)+ $field:ident: $type:ty;)+) => {
        /// Summary of the time steps of one call: sums or worst values over the steps.
        #[pyclass(module = "rover_gym.core", frozen)]
        pub struct StepReport {
            inner: CoreReport,
            undetermined_loads: usize,
        }

        #[pymethods]
        impl StepReport {
            $(
                $(#$doc)+
                #[getter]
                fn $field(&self) -> $type {
                    self.inner.$field
                }
            )+

            /// Whether the steps "converged" or "not_converged".
            ///
            /// "converged" means that the contact solver met its tolerance in every step, or
            /// `acceptable` where it was slow.
            #[getter]
            fn status(&self) -> &'static str {
                if self.is_converged() {
                    "converged"
                } else {
                    "not_converged"
                }
            }

            /// Whether `status` is "converged".
            #[getter]
            fn is_converged(&self) -> bool {
                self.inner.is_converged()
            }

            /// Number of contacts whose impulses the motion of the last step does not determine.
            ///
            /// 0 means that the motion determines the impulses of all contacts. Otherwise other
            /// impulses cause the same motion, and the step returns those of least norm within the
            /// cones of friction: four corners of a box share its weight like four equal springs.
            /// Friction counts: six rigid wheels that drive straight could push sideways against
            /// each other, so the number is 6. Contacts that yield, such as wheels with a
            /// `stiffness`, have determined impulses. Always 0 for grains. In a group of more than
            /// 32 rigid contacts the solver chooses among the impulses.
            #[getter]
            fn undetermined_loads(&self) -> usize {
                self.undetermined_loads
            }

            /// Combines this report with that of the following steps.
            ///
            /// Args:
            ///     later: Report of the following steps.
            fn followed_by(&self, later: &Self) -> Self {
                let mut inner = self.inner;
                inner.merge(&later.inner);
                Self::new(inner, later.undetermined_loads)
            }

            fn __repr__(&self) -> String {
                let (status, inner) = (self.status(), &self.inner);
                format!(
                    "StepReport(status={status:?}, steps={}, iterations={}, residual={:.3e}, \
                     n_contacts={})",
                    inner.steps, inner.iterations, inner.residual, inner.n_contacts
                )
            }
        }
    };
}

step_report! {
    /// Whether a contact problem stayed unsolved because the solver's `budget` was spent.
    ///
    /// With a larger `budget` it may be solved.
    budget_exhausted: bool;
    /// Number of contact problems whose answer met the option `acceptable` alone.
    acceptable: usize;
    /// Number of steps taken.
    steps: usize;
    /// Iterations of the contact solver, summed over the steps.
    iterations: usize;
    /// Newton iterations of the scheme, summed over the steps; 0 with the linearised scheme.
    newton_iterations: usize;
    /// Largest relative residual of a step's contact problem, computed from its impulses.
    ///
    /// If the energy audit slowed a rebound (`restitution` above 0), the residual includes the
    /// difference from Newton's law. `status` describes the solver alone.
    residual: f64;
    /// Largest number of contacts in a step.
    n_contacts: usize;
    /// Largest number of contacts in a step along whose normal closed loops let nothing move.
    ///
    /// Example: the wheels of a machine that is welded to a stand. Such a contact bears no load,
    /// unless its wheel is elastic, and an overlap there cannot be removed.
    immovable_contacts: usize;
    /// Widest gap of a closed loop at the end of a step, m or rad; 0 without loops.
    ///
    /// Above 1e-6 the status is "not_converged".
    loop_gap: f64;
    /// Number of repeated steps.
    ///
    /// A step is repeated if a motor reached its torque-speed line, if the energy audit requires
    /// implicit gyroscopic terms, or if Newton's law of restitution had no solution.
    retaken: usize;
    /// Number of steps that took more than the usual effort.
    ///
    /// Its contacts are solved with every means, and where that fails or something else is in the
    /// way, the rover takes it alone, in halves if need be. Always 0 for planar machines, for
    /// grains and for the variant "newton", whose steps all are.
    fallbacks: usize;
    /// Largest energy gain of a step beyond the work done on it, relative to the kinetic energy.
    energy_gain: f64;
    /// Spurious energy gain of the scheme that the audit removed, summed over the steps, J.
    energy_removed: f64;
    /// Work of torques, motors and wrenches, summed over the steps, J.
    energy_supplied: f64;
    /// Energy that commands since the last call have added to held joints, J.
    ///
    /// `Simulation.energy` contains it from the command on, so it is not part of the change over
    /// the call. 0 in the first call after the state was set or restored.
    energy_of_set_points: f64;
    /// Energy dissipated by friction, impacts, dampers and sand, summed over the steps, J.
    ///
    /// It can be negative with Newton's law of restitution and friction. A new contact counts as an
    /// impact if it closes faster than gravity explains.
    energy_dissipated: f64;
    /// Numerical energy loss of the scheme, summed over the steps, J; negative if energy is gained.
    ///
    /// The change of the energy over the call is `energy_supplied` plus `energy_lifted` and
    /// `energy_released`, minus `energy_dissipated`, `energy_lost` and `energy_removed`.
    /// `energy_lost` therefore contains the errors of the time stepping and the work of reactions
    /// in persistent contacts. In smooth motion it shrinks with the square of the time step. Always
    /// 0 for grains, whose energy is not audited.
    energy_lost: f64;
    /// Work against gravity and springs by removing penetration, summed over the steps, J.
    ///
    /// The work of the actuators on the way is part of `energy_supplied`.
    energy_lifted: f64;
    /// Energy released by elastic wheels, summed over the steps, J; negative if they stored energy.
    ///
    /// Wheels are elastic if the model gives them a `stiffness`. The energy of their springs is
    /// part of neither the kinetic nor the potential energy. It is an account: a step enters what
    /// the wheels took from the machine, up to what their deflections can hold, and the sum over a
    /// run is no more than they held at its start.
    energy_released: f64;
}

impl StepReport {
    /// The core's report, and the number of contacts whose impulses the motion leaves open.
    pub fn new(inner: CoreReport, undetermined_loads: usize) -> Self {
        Self {
            inner,
            undetermined_loads,
        }
    }
}

/// Kinetic and potential energy.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct Energy {
    /// Kinetic energy, J.
    kinetic: f64,
    /// Potential energy in gravity, springs and the stiffness of held joints, J.
    ///
    /// That in gravity is zero with all mass centres at the world's origin.
    potential: f64,
    /// Sum of both, J.
    total: f64,
}

impl From<CoreEnergy> for Energy {
    fn from(inner: CoreEnergy) -> Self {
        Self {
            kinetic: inner.kinetic,
            potential: inner.potential,
            total: inner.total(),
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
