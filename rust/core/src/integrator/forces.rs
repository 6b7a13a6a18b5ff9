//! The forces of systems, without those of their contacts.

use super::dynamics::{Dynamics, DynamicsMask};
use super::options::StepOptions;
use super::work::Work;

/// Most repetitions of a step because a piecewise force changed its branch. A motor that reaches
/// its torque–speed line needs one, a single wheel at most four.
pub(crate) const MOST_REVISIONS: usize = 6;

/// Start of a step.
#[derive(Debug)]
pub struct StepStart<'a, Q, T = f64> {
    /// Configuration.
    pub configuration: &'a Q,
    /// Velocity (nv).
    pub v: &'a [T],
}

impl<'a, Q, T> StepStart<'a, Q, T> {
    /// At a configuration and a velocity (nv).
    pub fn at(configuration: &'a Q, v: &'a [T]) -> Self {
        Self { configuration, v }
    }
}

impl<Q, T> Clone for StepStart<'_, Q, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<Q, T> Copy for StepStart<'_, Q, T> {}

/// Start of a step of a kind of systems.
pub type StartOf<'a, S> = StepStart<'a, <S as Dynamics>::Configuration, <S as Dynamics>::T>;

/// The impulse of the forces over a step, their branches and their work.
pub trait Forces: Dynamics {
    /// [`Self::load`] at the velocity before the step, from which the mean velocity follows; the
    /// first of the loads in a step and in each repetition of it.
    fn begin_load(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        impulse: &mut [Self::T],
    ) {
        self.load(options, start, start.v, impulse);
    }

    /// `impulse = h F(q_m, v_mean)` (nv), N s and N m s: the impulse of all forces except contact
    /// forces over the step.
    ///
    /// Implicit forces enter with their value extrapolated from the velocity at the start.
    fn load(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_mean: &[Self::T],
        impulse: &mut [Self::T],
    );

    /// Adds to the impulse of [`Self::load`] (nv) what does not act on the mean velocity. By
    /// default nothing.
    fn add_given(&self, _options: &StepOptions, _impulse: &mut [Self::T]) {}

    /// [`Self::load`] with implicit gyroscopic terms.
    ///
    /// With `C(q_m, v_mean) v` the gyroscopic part of the bias and J
    /// (`impulse`, nv) a forecast of the contacts' generalized impulse
    ///
    /// ```text
    /// (M̂ + θ h C) Δv = h (τ − G − C v) + J,        y = M̂ Δv − J
    /// ```
    ///
    /// If the actual impulse equals the forecast J, the whole step is implicit. Called only for a
    /// system of which [`Dynamics::turning`] marks a cluster.
    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_mean: &[Self::T],
        _impulse: &[Self::T],
        y: &mut [Self::T],
    ) {
        self.load(options, start, v_mean, y);
    }

    /// Chooses the branch of each piecewise force at the start of a step. By default there is none.
    /// `v` (nv): before it.
    fn choose_branches(&mut self, _v: &[Self::T]) {}

    /// Whether a force may be on another branch at the end of the step. By default it may.
    fn may_revise(&self) -> bool {
        true
    }

    /// Moves each piecewise force of some lanes, at least one, a branch towards that which holds at
    /// `v_end`. Returns the lanes of which a branch has changed, whose step must be repeated. By
    /// default there is none.
    fn revise(
        &mut self,
        lanes: DynamicsMask<Self>,
        _v: &[Self::T],
        _v_end: &[Self::T],
    ) -> DynamicsMask<Self> {
        lanes & !lanes
    }

    /// Lanes whose repetitions are used up and whose forces are not those at the solution. By
    /// default there is none.
    fn unsettled(&mut self, lanes: DynamicsMask<Self>, _v_end: &[Self::T]) -> DynamicsMask<Self> {
        lanes & !lanes
    }

    /// Most repetitions of a lane's step that [`Self::revise`] asks for.
    fn most_revisions(&self, _lane: usize) -> usize {
        MOST_REVISIONS
    }

    /// Work of the own forces of each cluster (n_clusters) but gravity over a step that ends with
    /// `v_end`; `out` is zero before. By default they do none.
    fn work(
        &mut self,
        _options: &StepOptions,
        _start: StartOf<'_, Self>,
        _v_end: &[Self::T],
        _out: &mut [Work<Self::T>],
    ) {
    }

    /// Energy that springs and position controls of each cluster (n_clusters) store in a
    /// configuration, J, but for a constant; `out` is zero before. By default there are none.
    fn stored(&self, _q: &Self::Configuration, _out: &mut [Self::T]) {}

    /// Work that the torques, motors and wrenches of such a step, as they are at its end, supply
    /// over a `displacement` (nv) that is added to it, J; none, the default, where nothing supplies
    /// any.
    fn work_of_displacement(
        &mut self,
        _options: &StepOptions,
        _start: StartOf<'_, Self>,
        _v_end: &[Self::T],
        _displacement: &[Self::T],
    ) -> Option<Self::T> {
        None
    }

    /// The step (or part of a step) whose work was last requested becomes the state in some lanes.
    /// By default nothing is recorded.
    fn accept(&mut self, _lanes: DynamicsMask<Self>) {}

    /// [`Self::load`] for the iterate `v_end`: implicit forces enter with their value there. By
    /// default there are none.
    fn load_at_end(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        _v_end: &[Self::T],
        v_mean: &[Self::T],
        impulse: &mut [Self::T],
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
        start: StartOf<'_, Self>,
        v_end: &[Self::T],
        v_mean: &[Self::T],
        scratch: &mut [Self::T],
        impulse: &mut [Self::T],
    ) {
        for ((change, end), begin) in impulse.iter_mut().zip(v_end).zip(start.v) {
            *change = *end - *begin;
        }
        self.multiply_mass(impulse, scratch);
        self.load_at_end(options, start, v_end, v_mean, impulse);
        for (impulse, momentum) in impulse.iter_mut().zip(&*scratch) {
            *impulse -= *momentum;
        }
    }
}
