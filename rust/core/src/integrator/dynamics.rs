//! The dynamics of a system: configurations, poses, the mass matrix and its factor, closed loops.

use nalgebra::Vector3;

use super::carried_velocity::Moving;
use super::options::StepOptions;
use crate::problem::Dimension;

/// Penetration that is tolerated by default, m, of a system without a size of its own.
const TOLERATED: f64 = 1e-8;

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
    /// Energy and momentum of two clusters together.
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

/// What moves, and its inertia. Vectors of factor coordinates as in [`super::mechanical_system`].
pub trait Dynamics {
    /// A point of the configuration space, of any size; the system defines ⊕.
    type Configuration: Clone + PartialEq;

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

    /// Computes M at the middle pose, and the implicit weights of the stiff forces.
    fn update_mass_matrix(&mut self, options: &StepOptions);

    /// Factors `M̂ = M + (implicit forces) = Fᵀ F`; false if it is not positive definite in
    /// floating point.
    #[must_use]
    fn factorise(&mut self, options: &StepOptions) -> bool;

    /// `out = M v` (nv), kg m/s and kg m²/s. Called between `update_mass_matrix` and `factorise`,
    /// which may add implicit terms.
    fn multiply_mass(&self, v: &[f64], out: &mut [f64]);

    /// Whether the gyroscopic terms of a cluster are too stiff to be explicit in this step. By
    /// default never.
    fn is_gyroscopic(&self, _options: &StepOptions, _v: &[f64], _cluster: usize) -> bool {
        false
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

    /// Whether [`super::Forces::balance`] conserves the momenta of free flight at any step, so that
    /// no energy correction may change them. By default it does not.
    fn conserves_momenta(&self) -> bool {
        false
    }

    /// `y = F⁻ᵀ impulse`, in place: an impulse (nv) into factor coordinates.
    fn half_solve(&self, impulse: &mut [f64]);

    /// Changes `y` so that the step from `v_begin` to `v + F⁻¹ y` obeys the system's closed loops.
    /// [`super::Contacting::add_impulses`] keeps that. By default there are none.
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

    /// Penetration of a cluster that is tolerated, m.
    fn tolerated(&self, options: &StepOptions, _cluster: usize) -> f64 {
        options.penetration_tolerance.unwrap_or(TOLERATED)
    }

    /// Largest displacement of a cluster, m, that `y` (nv) causes away from the contact points; it
    /// limits the projection.
    fn displacement(&self, y: &[f64], cluster: usize) -> f64;
}
