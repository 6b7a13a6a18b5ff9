//! Nonsmooth multibody mechanics of a wheeled rover.
//!
//! The machine is a tree of rigid bodies on a free base. Its wheels touch the ground through
//! unilateral contacts with Coulomb friction and Newton impact. A step of length h solves, for the
//! velocity v⁺ and the contact impulses p,
//!
//! ```text
//! M(q) (v⁺ − v) = h (T u − N(q, v) v − G(q)) + H(q) p
//! u = Hᵀ v⁺,    ũ = u + e u_N⁻ n + μ |u_T| n,    K_μ* ∋ ũ ⊥ p ∈ K_μ   at every contact.
//! ```
//!
//! Chapters, each using only those above it:
//!
//! - [`caught`]: panics that become errors; `pool`: threads that survive a fork;
//! - [`quantity`]: admissible numbers of a description; [`scalar`]: one rover or several to a
//!   register; [`spatial`]: rotations and inertias;
//! - [`cone`], [`law`]: the friction cone and the contact laws, one contact at a time;
//! - [`multibody`]: model, state, kinematics, mass matrix, bias, energy, momentum;
//! - [`sand`]: the force of sand on a wheel;
//! - [`geometry`]: shapes, the ground, distances between them; [`contact`]: points, frames, gaps,
//!   the Delassus operator;
//! - [`problem`], [`solver`]: the friction-contact problem, which sees only (W, q, μ);
//! - [`integrator`]: one step of any mechanical system;
//! - [`planar`]: grounds and machines in the plane; [`system`]: the mechanical systems that a step
//!   moves, such as the multibody tree;
//! - [`lanes`]: the fast step of one rover or several to a register;
//! - [`simulation`]: many steps of any scene;
//! - [`draw`]: random numbers, for scenes that are drawn;
//! - [`episode`]: the episodes of a driving task: actions, observations, rewards, ends;
//! - [`paths`]: what a rover would touch on a path over known heights, and the cheapest of many.
#![forbid(unsafe_code)]
// Same bits on every machine: sines and their like come from `scalar::elementary`.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub use nalgebra;

pub mod caught;
pub mod cone;
pub mod contact;
pub mod draw;
pub mod episode;
pub mod geometry;
pub mod integrator;
pub mod lanes;
pub mod law;
pub mod multibody;
pub mod paths;
pub mod planar;
mod pool;
pub mod problem;
pub mod quantity;
pub mod sand;
pub mod scalar;
pub mod simulation;
pub mod solver;
pub mod spatial;
pub mod system;
