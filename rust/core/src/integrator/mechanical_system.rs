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

use super::contacting::Contacting;
use super::forces::Forces;

/// A system with unilateral contacts: what has [`super::Dynamics`], [`Forces`] and [`Contacting`].
pub trait MechanicalSystem: Forces<T = f64, Configuration: PartialEq> + Contacting {}

impl<S: Forces<T = f64, Configuration: PartialEq> + Contacting> MechanicalSystem for S {}
