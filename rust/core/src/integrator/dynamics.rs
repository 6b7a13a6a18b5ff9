//! The dynamics of systems: configurations, poses, the mass matrix and its factor, closed loops.

use super::options::StepOptions;
use crate::scalar::{Lane, LaneMask, Vec3};

/// Penetration that is tolerated by default, m, of a system without a size of its own.
const TOLERATED: f64 = 1e-8;

/// A truth value for each lane of systems.
pub type DynamicsMask<S> = <<S as Dynamics>::T as Lane>::Mask;

/// What moves, and its inertia: one system, or one in each lane of the scalar. Vectors of factor
/// coordinates as in [`super::mechanical_system`].
pub trait Dynamics {
    /// The scalar: `f64` for one system.
    type T: Lane;

    /// A point of the configuration space, of any size; the system defines ⊕.
    type Configuration: Clone;

    /// Current number of velocities.
    fn nv(&self) -> usize;

    /// Number of clusters, see `super::grouped`; by default the system is one.
    fn n_clusters(&self) -> usize {
        1
    }

    /// The cluster of a velocity.
    fn cluster_of_velocity(&self, _k: usize) -> usize {
        0
    }

    /// The axis along which a velocity translates all that its root carries; by default none.
    fn translation_axis(&self, _velocity: usize) -> Option<usize> {
        None
    }

    /// Whether a cluster passes its momentum on to the world, by a base or a loop. By default it
    /// does not.
    fn is_held(&self, _cluster: usize) -> bool {
        false
    }

    /// `to = from ⊕ h v`, without allocating.
    fn set_moved(
        &self,
        from: &Self::Configuration,
        v: &[Self::T],
        h: f64,
        to: &mut Self::Configuration,
    ) {
        to.clone_from(from);
        self.advance(to, v, h);
    }

    /// `q ⊕= h v`.
    fn advance(&self, q: &mut Self::Configuration, v: &[Self::T], h: f64);

    /// Takes the coordinates of each cluster from another configuration in the lanes of its mask;
    /// by default for one cluster in one lane.
    fn take(
        &self,
        lanes: impl Fn(usize) -> DynamicsMask<Self>,
        from: &Self::Configuration,
        to: &mut Self::Configuration,
    ) {
        if lanes(0).any() {
            to.clone_from(from);
        }
    }

    /// Whether every entry of a configuration is finite.
    fn is_finite(&self, q: &Self::Configuration) -> DynamicsMask<Self>;

    /// Removes rounding from a configuration that is about to become the state (unit quaternions).
    fn normalise(&self, _q: &mut Self::Configuration) {}

    /// Kinematics at the configuration where forces and mass matrix are evaluated.
    fn place_middle(&mut self, q: &Self::Configuration);

    /// Kinematics at the configuration where contact frames and Jacobians are evaluated.
    fn place_end(&mut self, q: &Self::Configuration);

    /// Computes M at the middle pose, and the implicit weights of the stiff forces. `going`: lanes
    /// of the step. `is_first`: unless the step is taken again.
    fn update_mass_matrix(
        &mut self,
        options: &StepOptions,
        going: DynamicsMask<Self>,
        is_first: bool,
    );

    /// Factors `M̂ = M + (implicit forces) = Fᵀ F`; false if it is not positive definite in
    /// floating point.
    #[must_use]
    fn factorise(&mut self, options: &StepOptions) -> DynamicsMask<Self>;

    /// `out = M v` (nv), kg m/s and kg m²/s. Called between `update_mass_matrix` and `factorise`,
    /// which may add implicit terms.
    fn multiply_mass(&self, v: &[Self::T], out: &mut [Self::T]);

    /// Largest angular speed of a frame whose pose matters, rad/s; none, the default, where no
    /// frame turns. Marks in `is_gyroscopic` (n_clusters), where nothing is marked, the clusters
    /// whose gyroscopic terms are too stiff to be explicit in this step.
    fn turning(
        &mut self,
        _options: &StepOptions,
        _v: &[Self::T],
        _is_gyroscopic: &mut [DynamicsMask<Self>],
    ) -> Option<Self::T> {
        None
    }

    /// Whether the system has an energy that is audited. By default it has none.
    fn is_audited(&self) -> bool {
        false
    }

    /// Calls `each` with every cluster, its kinetic and potential energy in a state, J, and its
    /// linear momentum, kg m/s. Called only for a system that [is audited](Self::is_audited).
    fn energies(
        &mut self,
        _options: &StepOptions,
        _q: &Self::Configuration,
        _v: &[Self::T],
        _each: impl FnMut(usize, [Self::T; 2], Vec3<Self::T>),
    ) {
    }

    /// Mass of a cluster, kg; none, the default, if neither an energy nor a compliance needs it.
    fn mass(&self, _cluster: usize) -> Option<Self::T> {
        None
    }

    /// Whether [`super::Forces::balance`] conserves the momenta of free flight at any step, so that
    /// no energy correction may change them. By default it does not.
    fn conserves_momenta(&self) -> bool {
        false
    }

    /// `y = F⁻ᵀ impulse`, in place: an impulse (nv) into factor coordinates.
    fn half_solve(&self, impulse: &mut [Self::T]);

    /// Changes `y` so that the step from `v_begin` to `v + F⁻¹ y` obeys the system's closed loops.
    /// [`super::MechanicalSystem::add_impulses`] keeps that. By default there are none.
    fn close_velocity(
        &mut self,
        _options: &StepOptions,
        _v_begin: &[Self::T],
        _v: &[Self::T],
        _y: &mut [Self::T],
    ) {
    }

    /// `out +=` the generalized impulse (nv) of the loops after the last
    /// [`Self::close_velocity`], without that of contacts.
    fn add_loop_impulse(&mut self, _out: &mut [Self::T]) {}

    /// Makes a configuration and a velocity at the end of a step obey the closed loops in some
    /// lanes; p (d n_c): the step's impulses. Returns the widest gap that is left, m or rad; none
    /// without loops.
    fn close_end(
        &mut self,
        _lanes: DynamicsMask<Self>,
        _p: &[Self::T],
        _q: &mut Self::Configuration,
        _v: &mut [Self::T],
    ) -> Option<Self::T> {
        None
    }

    /// `Δv = F⁻¹ y`, in place: factor coordinates (nv) into a change of the velocity.
    fn half_solve_back(&self, y: &mut [Self::T]);

    /// Penetration of a cluster that is tolerated, m.
    fn tolerated(&self, options: &StepOptions, _cluster: usize) -> f64 {
        options.penetration_tolerance.unwrap_or(TOLERATED)
    }

    /// Largest displacement of a cluster, m, that `y` (nv) causes away from the contact points; it
    /// limits the projection.
    fn displacement(&self, y: &[Self::T], cluster: usize) -> Self::T;
}
