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
//! A drive (`cargo run --release -p rover-core --example drive`; in a project of your own, after
//! `cargo add rover-core --path rust/core`):
//!
//! ```no_run
#![doc = include_str!("../examples/drive.rs")]
//! ```
//!
//! The laws and solvers of contact are those of [`friction_contact`], with the chapters `cone`,
//! `law`, `pool`, `problem`, `quantity`, `scalar` and `solver`; shapes, ground and sand are those
//! of [`rover_ground`], with the chapters `spatial`, `sand` and `geometry`.
//!
//! Chapters, each using only those above it:
//!
//! - [`caught`]: panics that become errors;
//! - [`multibody`]: model, state, kinematics, mass matrix, bias, energy, momentum;
//! - [`contact`]: points, frames, gaps, the Delassus operator;
//! - [`integrator`]: one step of any mechanical system;
//! - [`planar`]: grounds and machines in the plane; [`system`]: the mechanical systems that a step
//!   moves, such as the multibody tree;
//! - [`simulation`]: many steps of any scene.
#![forbid(unsafe_code)]
// Same bits on every machine: sines and their like come from `scalar::elementary`.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub use friction_contact::{cone, law, pool, problem, quantity, scalar, solver};
pub use nalgebra;
pub use rover_ground::{geometry, sand, spatial};

pub mod caught;
pub mod contact;
pub mod integrator;
pub mod multibody;
pub mod planar;
pub mod simulation;
pub mod system;
