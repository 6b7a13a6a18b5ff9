//! The interface of time stepping to a mechanical system `M(q) dv = F(q, v) dt + H(q) dp`, in which
//! ⊕ moves q along v.
//!
//! Every scheme of this chapter is written once, over this trait. The multibody tree implements it
//! with its sparse factor, a planar ball or two-wheel rover with small dense matrices, and a bed of
//! disks with a diagonal matrix.
//!
//! A system holds its description and scratch for its matrices, never its state. The scheme passes
//! in configurations and velocities and calls in the order
//!
//! ```text
//! place_middle(q_m), place_end(q̃) → detect → relocate      the contacts, measured at q̃
//! update_mass_matrix → factorise                           M̂(q_m) = Fᵀ F
//! assemble                                                 H, Z = F⁻ᵀ H, W = Zᵀ Z at q̃
//! load, half_solve, close_velocity, local, problem, add_impulses, half_solve_back
//! close_end                                                closed loops, at the end of the step
//! ```
//!
//! Vectors between `half_solve` and `half_solve_back` are in *factor coordinates* `y = F v`. In
//! these an impulse y changes the contact velocities by `Zᵀ y`, and contact impulses p change y by
//! `Z p`, so W needs no product with M̂⁻¹. Any factor serves (Cholesky's, the tree's `Lᵀ D L`, the
//! square root of a diagonal).

use nalgebra::Vector3;

use super::carried_velocity::Moving;
use super::options::StepOptions;
use super::work::Work;
use crate::contact::Activation;
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::problem::{Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

/// Most repetitions of a step because a piecewise force changed its branch. A motor that reaches
/// its torque–speed line needs one, a single wheel at most four.
pub(crate) const MOST_REVISIONS: usize = 6;

/// Penetration that is tolerated by default, m, of a system without a size of its own.
const TOLERATED: f64 = 1e-8;

/// A contact as time stepping sees it: a key and a gap.
pub trait UnilateralContact {
    /// Identifies a contact from one step to the next.
    type Key: Copy + Ord;

    /// Its key, unique within a step.
    fn key(&self) -> Self::Key;

    /// Signed distance where the contact was last measured, m, positive when apart.
    fn gap(&self) -> f64;

    /// Whether both its sides belong to the system, so that its impulses keep the momentum. By
    /// default it is one with the world.
    fn is_internal(&self) -> bool {
        false
    }
}

/// Key of a system's contacts.
pub type KeyOf<S> = <<S as MechanicalSystem>::Contact as UnilateralContact>::Key;

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

/// Energy of a state, and its overall momentum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MechanicalEnergy {
    /// J.
    pub kinetic: f64,
    /// J.
    pub potential: f64,
    /// Linear momentum, kg m/s.
    pub momentum: Vector3<f64>,
    /// kg.
    pub mass: f64,
    /// Whether a base or a loop passes the momentum on to the world; the momentum is zero then.
    pub is_held: bool,
}

impl MechanicalEnergy {
    /// Those of two clusters together.
    pub(crate) fn with(self, other: Self) -> Self {
        let is_held = self.is_held || other.is_held;
        let momentum = self.momentum + other.momentum;
        Self {
            kinetic: self.kinetic + other.kinetic,
            potential: self.potential + other.potential,
            momentum: if is_held { Vector3::zeros() } else { momentum },
            mass: self.mass + other.mass,
            is_held,
        }
    }
}

impl MechanicalEnergy {
    /// By how much it exceeds that of another state, J.
    pub(crate) fn above(&self, other: &Self) -> f64 {
        (self.kinetic - other.kinetic) + (self.potential - other.potential)
    }

    /// What of it a change of the velocity changes.
    pub(crate) fn moving(&self) -> Moving<f64> {
        Moving {
            kinetic: self.kinetic,
            momentum: self.momentum.into(),
        }
    }
}

/// A system with unilateral contacts, see the page above.
///
/// With d components a contact (2 or 3, `DIMENSION`), local vectors run
/// contact by contact `normal, tangent, (tangent)`.
pub trait MechanicalSystem {
    /// A point of the configuration space, of any size; the system defines ⊕.
    type Configuration: Clone + PartialEq;
    /// A contact: the data from which the system rebuilds its rows of Hᵀ.
    type Contact: UnilateralContact + Clone;

    /// Whether contacts have one tangent or two.
    const DIMENSION: Dimension;

    /// Current number of velocities.
    fn nv(&self) -> usize;

    /// Number of clusters, see `super::groups`; by default the system is one.
    fn n_clusters(&self) -> usize {
        1
    }

    /// The cluster of a velocity.
    fn cluster_of_velocity(&self, _k: usize) -> usize {
        0
    }

    /// The two clusters that a contact touches, the same one twice where it touches no other.
    fn clusters_of(&self, _key: &KeyOf<Self>) -> [usize; 2]
    where
        Self: Sized,
    {
        [0, 0]
    }

    /// Takes the coordinates of some clusters from another configuration. Called only for a system
    /// of several clusters.
    fn take_clusters(
        &self,
        _from: &Self::Configuration,
        _is_taken: &dyn Fn(usize) -> bool,
        _to: &mut Self::Configuration,
    ) {
    }

    /// `to = from ⊕ h v`, without allocating.
    fn set_moved(
        &self,
        from: &Self::Configuration,
        v: &[f64],
        h: f64,
        to: &mut Self::Configuration,
    ) {
        to.clone_from(from);
        self.advance(to, v, h);
    }

    /// `q ⊕= h v`.
    fn advance(&self, q: &mut Self::Configuration, v: &[f64], h: f64);

    /// Whether every entry of a configuration is finite.
    fn is_finite(&self, q: &Self::Configuration) -> bool;

    /// Removes rounding from a configuration that is about to become the state (unit quaternions).
    fn normalise(&self, _q: &mut Self::Configuration) {}

    /// Kinematics at the configuration where forces and mass matrix are evaluated.
    fn place_middle(&mut self, q: &Self::Configuration);

    /// Kinematics at the configuration where contact frames and Jacobians are evaluated.
    fn place_end(&mut self, q: &Self::Configuration);

    /// Finds the contacts of the step: measures them at the middle pose and forecasts with the
    /// velocity `v` (nv).
    ///
    /// `activation.margin` is 0 on entry; the system fills it. `out` is cleared first.
    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<Self::Contact>);

    /// Measures point, frame and gap of the same features again at the end pose.
    fn relocate(&mut self, contacts: &mut [Self::Contact]);

    /// A place (x, z, m) near the machine where the last detection found that the ground is not
    /// known. The step then fails. By default all ground is known.
    fn unknown_ground(&self) -> Option<[f64; 2]> {
        None
    }

    /// μ of one contact.
    fn friction_coefficient(&self, options: &StepOptions, _contact: &Self::Contact) -> f64 {
        options.friction_coefficient
    }

    /// Computes M at the middle pose, and the implicit weights of the stiff forces.
    fn update_mass_matrix(&mut self, options: &StepOptions);

    /// Factors `M̂ = M + (implicit forces) = Fᵀ F`; false if it is not positive definite in
    /// floating point.
    #[must_use]
    fn factorise(&mut self, options: &StepOptions) -> bool;

    /// `out = M v` (nv), kg m/s and kg m²/s. Called between `update_mass_matrix` and `factorise`,
    /// which may add implicit terms.
    fn multiply_mass(&self, v: &[f64], out: &mut [f64]);

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

    /// Whether the gyroscopic terms of a cluster are too stiff to be explicit in this step. By
    /// default never.
    fn is_gyroscopic(&self, _options: &StepOptions, _v: &[f64], _cluster: usize) -> bool {
        false
    }

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
    /// system that may be [`Self::is_gyroscopic`].
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

    /// Kinetic and potential energy of each cluster in a state, J, and its momentum; `out` is
    /// cleared first, and stays empty if the system is not audited.
    fn energies(
        &mut self,
        _options: &StepOptions,
        _q: &Self::Configuration,
        _v: &[f64],
        out: &mut Vec<MechanicalEnergy>,
    ) {
        out.clear();
    }

    /// Largest angular speed of a frame whose pose matters, rad/s. By default 0.
    fn turning(&self, _v: &[f64]) -> f64 {
        0.0
    }

    /// The axis along which a velocity translates all that its root carries; none for any other
    /// velocity. By default the first velocities are those of the only root.
    fn translation_axis(&self, velocity: usize) -> Option<usize> {
        (velocity < Self::DIMENSION.components()).then_some(velocity)
    }

    /// Whether [`Self::balance`] conserves the momenta of free flight at any step, so that no
    /// energy correction may change them. By default it does not.
    fn conserves_momenta(&self) -> bool {
        false
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

    /// `y = F⁻ᵀ impulse`, in place: an impulse (nv) into factor coordinates.
    fn half_solve(&self, impulse: &mut [f64]);

    /// Changes `y` so that the step from `v_begin` to `v + F⁻¹ y` obeys the system's closed loops.
    /// [`Self::add_impulses`] keeps that. By default there are none.
    fn close_velocity(
        &mut self,
        _options: &StepOptions,
        _v_begin: &[f64],
        _v: &[f64],
        _y: &mut [f64],
    ) {
    }

    /// `out +=` the generalized impulse (nv) of the loops after the last
    /// [`Self::close_velocity`], with the contacts' impulses p (d n_c, or none).
    fn add_loop_impulse(&mut self, _p: &[f64], _out: &mut [f64]) {}

    /// Makes a configuration and a velocity at the end of a step obey the closed loops; p: the
    /// step's impulses. Returns the widest gap that is left, m or rad.
    fn close_end(&mut self, _p: &[f64], _q: &mut Self::Configuration, _v: &mut [f64]) -> f64 {
        0.0
    }

    /// `Δv = F⁻¹ y`, in place: factor coordinates (nv) into a change of the velocity.
    fn half_solve_back(&self, y: &mut [f64]);

    /// Builds H, Z and W of the contacts at the end pose, and `u = Hᵀ v` (d n_c), m/s.
    fn assemble(&mut self, contacts: &[Self::Contact], v: &[f64], u: &mut [f64]);

    /// Whether closed loops let nothing move an assembled contact along its normal: it bears no
    /// load, unless it yields, and its overlap cannot be removed. By default there is none.
    fn is_immovable(&self, _contact: usize) -> bool {
        false
    }

    /// `out = Zᵀ y` (d n_c), m/s.
    fn local(&self, y: &[f64], out: &mut [f64]);

    /// `out += Hᵀ v` (d n_c), m/s, for a velocity other than that of [`Self::assemble`].
    fn add_local_of_velocity(&self, contacts: &[Self::Contact], v: &[f64], out: &mut [f64]);

    /// `y += Z p`, with p (d n_c) in N s.
    fn add_impulses(&self, p: &[f64], y: &mut [f64]);

    /// `out = H p` (nv): the generalized impulse, N s and N m s, of p (d n_c), N s.
    fn generalized_impulse(&self, contacts: &[Self::Contact], p: &[f64], out: &mut [f64]);

    /// The friction-contact problem of the assembled W, with the free
    /// velocity q (d n_c), m/s, and μ (n_c).
    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a>;

    /// Shift of the normal free velocity, m/s, which turns the problem's `0 ≤ u_N ⊥ p_N ≥ 0` into
    /// the contact's law.
    ///
    /// The default is Newton's impact law, `e u_N⁻`.
    fn normal_shift(
        &self,
        options: &StepOptions,
        _contact: &Self::Contact,
        u_N_before: f64,
    ) -> f64 {
        rebound(options.restitution, u_N_before)
    }

    /// Mass of a cluster, kg, of a machine of which any contact yields. By default none does.
    fn compliant_mass(&self, _cluster: usize) -> Option<f64> {
        None
    }

    /// Springs and damper of a contact at the velocity `v` (nv); `None`, the default, if it is
    /// rigid.
    fn compliance(&self, _contact: &Self::Contact, _v: &[f64]) -> Option<Compliance> {
        None
    }

    /// Adds numbers along n, t, b of each contact (n_c), 1/kg, to the diagonal of the assembled W.
    /// Called only for a system that has a [compliant mass](Self::compliant_mass).
    fn soften(&mut self, _diagonal: impl Iterator<Item = [f64; 3]>) {}

    /// Whether a solve that does not converge suggests that the problem has no answer. True by
    /// default; false where sweeps end early by design.
    fn solves_to_the_end(&self) -> bool {
        true
    }

    /// Solves [`Self::problem`]: p (d n_c), N s, in and out, and u (d n_c),
    /// m/s, out, as [`solve`] takes them.
    ///
    /// A system of very many bodies overrides this with a method that needs no W.
    fn solve(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        solve(&self.problem(q, mu), options, p, u, workspace)
    }

    /// Solves the problem of the step that leads to the velocity `v + F⁻¹ y` without contacts
    /// (`v`, nv; y in factor coordinates), as [`Self::solve`] does.
    ///
    /// A system whose contacts bear more than an impulse, such as moments of rolling friction,
    /// finds these here and keeps them for [`Self::add_moments`].
    fn solve_step(
        &mut self,
        _free: (&[f64], &[f64]),
        (q, mu): (&[f64], &[f64]),
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        self.solve(q, mu, options, p, u, workspace)
    }

    /// The step's problem, if its impulses are settled where the motion leaves some open: that of
    /// few contacts with a dense W. By default they stay as the solver finds them.
    fn open_problem<'a>(
        &'a self,
        _q: &'a [f64],
        _mu: &'a [f64],
    ) -> Option<FrictionContactProblem<'a>> {
        None
    }

    /// `y +=` the effect of what [`Self::solve_step`] found besides p. By default there is nothing.
    fn add_moments(&self, _y: &mut [f64]) {}

    /// What a unit of a contact's gap counts as where it is compared with lengths, m: of a stop, in
    /// rad, the arm of its joint. By default 1.
    fn lever(&self, _contact: &Self::Contact) -> f64 {
        1.0
    }

    /// Penetration of a cluster that is tolerated, m.
    fn tolerated(&self, options: &StepOptions, _cluster: usize) -> f64 {
        options.penetration_tolerance.unwrap_or(TOLERATED)
    }

    /// Largest displacement of a cluster, m, that `y` (nv) causes away from the contact points; it
    /// limits the projection.
    fn displacement(&self, y: &[f64], cluster: usize) -> f64;
}
