//! Report of a step.

use crate::contact::loops::MOST_OPEN;
use crate::solver::{SolveReport, SolveStatus};

/// Whether the equations of the step were solved to their tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepStatus {
    /// The equations were solved to their tolerance, or acceptably.
    #[default]
    Converged,
    /// The contact solver or Newton's iteration stopped above its tolerance, a loop stayed open, or
    /// the force of the sand is not that at the solution; the state is the best one found.
    NotConverged,
}

/// Report of a step, or of the worst of several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Worst status.
    pub status: StepStatus,
    /// Whether a solve that did not converge ended because its
    /// [budget](crate::solver::SolverOptions::budget) was spent: with a larger one it may converge.
    pub budget_exhausted: bool,
    /// Solves that ended with an acceptable answer, all steps together.
    pub acceptable: usize,
    /// Steps taken.
    pub steps: usize,
    /// Iterations of the contact solver, all steps together.
    pub iterations: usize,
    /// Matrices that the contact solver factored, all steps together.
    pub factorisations: usize,
    /// Iterations of the contact solver that pivoted, all steps together.
    pub pivots: usize,
    /// Newton iterations on the forces, all steps together (0 in the linearised variant).
    pub newton_iterations: usize,
    /// Largest natural-map residual, recomputed from the impulses; where the energy audit slowed a
    /// rebound, that violation of the law of restitution too. The status is the solver's.
    pub residual: f64,
    /// Widest gap of a closed loop at the end of a step, m or rad; 0 without loops.
    pub loop_gap: f64,
    /// Most contacts in a step.
    pub n_contacts: usize,
    /// Most contacts in a step that closed loops let nothing move along their normal, as under a
    /// machine on a test stand. They bear no load, unless they yield, and an overlap there stays.
    pub immovable_contacts: usize,
    /// Repeated steps: a motor changed its branch, the energy audit required it, or Newton's law of
    /// restitution had no solution.
    pub retaken: usize,
    /// Steps that took more than the usual effort.
    pub fallbacks: usize,
    /// Largest energy gain in a step beyond the work of gravity and actuators, as a fraction of its
    /// kinetic energy.
    pub energy_gain: f64,
    /// Energy that the scheme would have gained and the audit removed, all steps together, J.
    pub energy_removed: f64,
    /// Work of torques, motors and wrenches, all steps together, J.
    pub energy_supplied: f64,
    /// What commands since the last call have changed of the energy that position controls store,
    /// J. The energy contains it as soon as the command is given.
    pub energy_of_set_points: f64,
    /// Energy that friction and impacts took by their law, dampers and sand, all steps together, J.
    ///
    /// Newton's law of restitution with friction can make it negative.
    pub energy_dissipated: f64,
    /// Energy that the scheme lost, all steps together, J; negative where it gained.
    ///
    /// It is what all other entries leave unexplained of the change of the energy, of which that of
    /// springs and position controls is a part: errors of the time step, and the normal work of
    /// contacts that persist. 0 among grains, which are not audited.
    pub energy_lost: f64,
    /// Energy that contacts which yield gave off, all steps together, J; negative where they stored
    /// some. What they hold is remembered, so the sum over any run is no more than they held at its
    /// start. See [`crate::law::compliance::SpringEnergy`].
    pub energy_released: f64,
    /// Energy that position projection added against gravity and springs, beyond the actuators'
    /// work on the way, all steps together, J.
    pub energy_lifted: f64,
}

impl StepReport {
    /// Whether every step was solved to tolerance, or acceptably.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.status == StepStatus::Converged
    }

    /// Enters the report of a solve in the step.
    pub(super) fn enter(&mut self, solved: &SolveReport) {
        self.iterations += solved.iterations;
        self.factorisations += solved.factorisations();
        self.pivots += solved.pivots();
        self.residual = self.residual.max(solved.residual);
        self.acceptable += usize::from(solved.status == SolveStatus::Acceptable);
        if !solved.is_converged() {
            self.status = StepStatus::NotConverged;
            self.budget_exhausted |= solved.status == SolveStatus::BudgetExhausted;
        }
    }

    /// Enters the widest gap of the loops, m or rad.
    pub(crate) fn enter_loops(&mut self, gap: f64) {
        self.loop_gap = self.loop_gap.max(gap);
        if gap.is_nan() || gap > MOST_OPEN {
            self.status = StepStatus::NotConverged;
        }
    }

    /// Adds the report of a later step.
    pub fn merge(&mut self, later: &Self) {
        if later.status == StepStatus::NotConverged {
            self.status = StepStatus::NotConverged;
        }
        self.budget_exhausted |= later.budget_exhausted;
        self.acceptable += later.acceptable;
        self.steps += later.steps;
        self.iterations += later.iterations;
        self.factorisations += later.factorisations;
        self.pivots += later.pivots;
        self.newton_iterations += later.newton_iterations;
        self.residual = self.residual.max(later.residual);
        self.loop_gap = self.loop_gap.max(later.loop_gap);
        self.n_contacts = self.n_contacts.max(later.n_contacts);
        self.immovable_contacts = self.immovable_contacts.max(later.immovable_contacts);
        self.retaken += later.retaken;
        self.fallbacks += later.fallbacks;
        self.energy_gain = self.energy_gain.max(later.energy_gain);
        self.energy_removed += later.energy_removed;
        self.energy_supplied += later.energy_supplied;
        self.energy_of_set_points += later.energy_of_set_points;
        self.energy_dissipated += later.energy_dissipated;
        self.energy_lost += later.energy_lost;
        self.energy_lifted += later.energy_lifted;
        self.energy_released += later.energy_released;
    }
}
