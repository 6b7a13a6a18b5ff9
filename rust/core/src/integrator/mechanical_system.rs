//! The interface of time stepping to a mechanical system `M(q) dv = F(q, v) dt + H(q) dp`, in which
//! ⊕ moves q along v.
//!
//! The multibody tree implements it with its sparse factor, a planar ball or two-wheel rover with
//! small dense matrices, and a bed of disks with a diagonal matrix. Dynamics and forces are over a
//! scalar, contacts those of one system.
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

use std::fmt::Debug;

use super::dynamics::Dynamics;
use super::forces::{Forces, StartOf};
use super::local::Local;
use super::options::StepOptions;
use crate::contact::Activation;
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::problem::{Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace, solve};

/// A contact as time stepping sees it: a key and a gap.
pub trait UnilateralContact {
    /// Identifies a contact from one step to the next.
    type Key: Copy + Ord + Debug;
    /// `[f64; 2]` in the plane, `[f64; 3]` in space.
    type Local: Local<f64> + AsRef<[f64]> + PartialEq;

    /// Key of the contact, unique within a step.
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

/// Components of a system's contacts.
pub type LocalOf<S> = <<S as MechanicalSystem>::Contact as UnilateralContact>::Local;

/// Configuration of a system.
pub type ConfigurationOf<S> = <<S as MechanicalSystem>::Machine as Dynamics>::Configuration;

/// A system with unilateral contacts, of d components each (2 or 3, [`Self::DIMENSION`]): local
/// vectors run contact by contact `normal, tangent, (tangent)`.
pub trait MechanicalSystem {
    /// What moves, with its forces.
    type Machine: Forces<T = f64, Configuration: PartialEq>;

    /// What moves.
    fn machine(&self) -> &Self::Machine;

    /// What moves.
    fn machine_mut(&mut self) -> &mut Self::Machine;

    /// Whether contacts have one tangent or two.
    const DIMENSION: Dimension;

    /// A contact: the data from which the system rebuilds its rows of Hᵀ.
    type Contact: UnilateralContact + Clone;

    /// The two clusters that a contact touches, the same one twice where it touches no other.
    fn clusters_of(&self, _key: &KeyOf<Self>) -> [usize; 2]
    where
        Self: Sized,
    {
        [0, 0]
    }

    /// Finds the contacts of the step: measures them at the middle pose and forecasts with the
    /// velocity `v` (nv).
    ///
    /// `out` is cleared first.
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

    /// Whether any contact may yield. By default none does.
    fn yields(&self) -> bool {
        false
    }

    /// Springs and damper of a contact at the velocity `v` (nv); `None`, the default, if it is
    /// rigid.
    fn compliance(&self, _contact: &Self::Contact, _v: &[f64]) -> Option<Compliance> {
        None
    }

    /// Adds numbers along n, t, b of each contact (n_c), 1/kg, to the diagonal of the assembled W.
    /// Called only for a system of which contacts may [yield](Self::yields).
    fn soften(&mut self, _diagonal: impl Iterator<Item = [f64; 3]>) {}

    /// Whether a solve that does not converge suggests that the problem has no answer. True by
    /// default; false where sweeps end early by design.
    fn solves_to_the_end(&self) -> bool {
        true
    }

    /// Solves [`Self::problem`]: p (d n_c), N s, in and out, and u (d n_c),
    /// m/s, out, as [`solve`] takes them. `free`: the velocity (nv) to which the step without
    /// contacts leads is `v + F⁻¹ y` (y in factor coordinates); none where positions are projected.
    ///
    /// A system of very many bodies overrides this with a method that needs no W. A system whose
    /// contacts bear more than an impulse, such as moments of rolling friction, finds these here
    /// and keeps them for [`Self::add_moments`].
    fn solve(
        &mut self,
        _free: Option<(&[f64], &[f64])>,
        (q, mu): (&[f64], &[f64]),
        options: &SolverOptions,
        (p, u): (&mut [f64], &mut [f64]),
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        solve(&self.problem(q, mu), options, p, u, workspace)
    }

    /// Whether the impulses of a step are settled where the motion leaves some open: those of few
    /// contacts with a dense W. By default they stay as the solver finds them.
    const SETTLES: bool = false;

    /// Called before the iterations of a Newton variant: stores what [`Self::residual`] needs of
    /// the start. By default nothing.
    fn begin_residual(&mut self, _start: StartOf<'_, Self::Machine>) {}

    /// Residual of the balance of the step without contacts, see [`Forces::balance`], the default.
    fn residual(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self::Machine>,
        v_end: &[f64],
        v_mean: &[f64],
        scratch: &mut [f64],
        impulse: &mut [f64],
    ) {
        (self.machine_mut()).balance(options, start, v_end, v_mean, scratch, impulse);
    }

    /// `y +=` the effect of what [`Self::solve`] found besides p. By default there is nothing.
    fn add_moments(&self, _y: &mut [f64]) {}

    /// What a unit of a contact's gap counts as where it is compared with lengths, m: of a stop, in
    /// rad, the arm of its joint. By default 1.
    fn lever(&self, _contact: &Self::Contact) -> f64 {
        1.0
    }
}
