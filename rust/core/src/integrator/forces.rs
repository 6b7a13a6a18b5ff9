//! The forces of a system, without those of its contacts.

use super::dynamics::Dynamics;
use super::options::StepOptions;
use super::work::Work;

/// Most repetitions of a step because a piecewise force changed its branch. A motor that reaches
/// its torque–speed line needs one, a single wheel at most four.
pub(crate) const MOST_REVISIONS: usize = 6;

/// Start of a step.
#[derive(Debug)]
pub struct Start<'a, Q> {
    /// Configuration.
    pub configuration: &'a Q,
    /// Velocity (nv).
    pub v: &'a [f64],
}

impl<Q> Clone for Start<'_, Q> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<Q> Copy for Start<'_, Q> {}

/// The impulse of the forces over a step, their branches and their work.
pub trait Forces: Dynamics {
    /// `impulse = h F(q_m, v_mean)` (nv), N s and N m s: the impulse of all forces except contact
    /// forces over the step.
    ///
    /// Implicit forces enter with their value extrapolated from the velocity at the start.
    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_mean: &[f64],
        impulse: &mut [f64],
    );

    /// Adds to the impulse of [`Self::load`] (nv) what does not act on the mean velocity. By
    /// default nothing.
    fn add_given(&self, _options: &StepOptions, _impulse: &mut [f64]) {}

    /// [`Self::load`] with implicit gyroscopic terms; the result is in factor coordinates.
    ///
    /// With `C(q_m, v_mean) v` the gyroscopic part of the bias and J
    /// (`impulse`, nv) a forecast of the contacts' generalized impulse
    ///
    /// ```text
    /// (M̂ + θ h C) Δv = h (τ − G − C v) + J,        y = F Δv − F⁻ᵀ J
    /// ```
    ///
    /// If the actual impulse equals the forecast J, the whole step is implicit. Called only for a
    /// system that may be [`Dynamics::is_gyroscopic`].
    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_mean: &[f64],
        _impulse: &[f64],
        y: &mut [f64],
    ) {
        self.load(options, start, v_mean, y);
        self.half_solve(y);
    }

    /// Chooses the branch of each piecewise force at the start of a step. By default there is none.
    fn choose_branches(&mut self, _start: Start<'_, Self::Configuration>) {}

    /// Moves each piecewise force one branch towards the branch that holds at `v_end`; true if one
    /// has changed and the step must be repeated. By default there is none.
    fn revise(&mut self, _start: Start<'_, Self::Configuration>, _v_end: &[f64]) -> bool {
        false
    }

    /// Whether the forces of a step whose repetitions are used up are those at its solution. By
    /// default they are.
    fn is_settled(&mut self, _v_end: &[f64]) -> bool {
        true
    }

    /// Most repetitions of a step that [`Self::revise`] asks for.
    fn most_revisions(&self) -> usize {
        MOST_REVISIONS
    }

    /// Work of the own forces of each cluster (n_clusters) but gravity over a step that ends with
    /// `v_end`.
    fn work(
        &mut self,
        _options: &StepOptions,
        _start: Start<'_, Self::Configuration>,
        _v_end: &[f64],
        out: &mut [Work],
    ) {
        out.fill(Work::default());
    }

    /// Energy that springs and position controls of each cluster (n_clusters) store in a
    /// configuration, J, but for a constant. By default there are none.
    fn stored(&self, _q: &Self::Configuration, out: &mut [f64]) {
        out.fill(0.0);
    }

    /// Work that the torques, motors and wrenches of such a step, as they are at its end, supply
    /// over a `displacement` (nv) that is added to it, J.
    fn work_of_displacement(
        &mut self,
        _options: &StepOptions,
        _start: Start<'_, Self::Configuration>,
        _v_end: &[f64],
        _displacement: &[f64],
    ) -> f64 {
        0.0
    }

    /// The step (or part of a step) whose work was last requested becomes the state. By default
    /// nothing is recorded.
    fn accept(&mut self) {}

    /// Called before the iterations of a Newton variant: stores what it needs of the start. By
    /// default nothing.
    fn begin_balance(&mut self, _start: Start<'_, Self::Configuration>) {}

    /// [`Self::load`] for the iterate `v_end`: implicit forces enter with their value there. By
    /// default there are none.
    fn load_at_end(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        _v_end: &[f64],
        v_mean: &[f64],
        impulse: &mut [f64],
    ) {
        self.load(options, start, v_mean, impulse);
    }

    /// `impulse = h F − Δ(M v)` (nv): residual of the balance of the step without contacts, at the
    /// iterate `v_end`.
    ///
    /// The default is the midpoint rule, `h F(q_m, v_mean) − M(q_m) (v_end − v)`, of order 2 for
    /// θ = ½. `scratch` (nv) may be overwritten.
    fn balance(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Self::Configuration>,
        v_end: &[f64],
        v_mean: &[f64],
        scratch: &mut [f64],
        impulse: &mut [f64],
    ) {
        for ((change, end), begin) in impulse.iter_mut().zip(v_end).zip(start.v) {
            *change = end - begin;
        }
        self.multiply_mass(impulse, scratch);
        self.load_at_end(options, start, v_end, v_mean, impulse);
        for (impulse, momentum) in impulse.iter_mut().zip(&*scratch) {
            *impulse -= momentum;
        }
    }
}
