//! Nonsmooth multibody mechanics of a wheeled rover.
//!
//! The machine is a tree of solids under a free base; its wheels are
//! unilateral contacts with Coulomb friction and Newton impact. A step of
//! length h solves, for the velocity v⁺ and the contact impulses p,
//!
//! ```text
//! M(q) (v⁺ − v) = h (T u − N(q, v) v − G(q)) + H(q) p
//! u = Hᵀ v⁺,    ũ = u + e u_N⁻ n + μ |u_T| n,    K_μ* ∋ ũ ⊥ p ∈ K_μ   at every contact.
//! ```
//!
//! Chapters, each using only those above it:
//!
//! - [`quantity`]: which numbers a description may have; [`spatial`]: rotations and inertias;
//! - [`multibody`]: model, state, kinematics, mass matrix, bias, energy, momentum;
//! - [`geometry`]: shapes, the ground, the distances between them;
//!   [`contact`]: points, frames, gaps, Delassus operator;
//! - [`cone`], [`law`], [`problem`], [`solver`]: the friction-contact
//!   problem, which sees only (W, q, μ);
//! - [`integrator`]: one step of any mechanical system;
//! - [`planar`]: grounds and machines of the plane; [`system`]: what the
//!   steps move, such as the tree of solids;
//! - [`simulation`]: many steps of any scene.
#![forbid(unsafe_code)]

pub use nalgebra;

pub mod cone;
pub mod contact;
pub mod geometry;
pub mod integrator;
pub mod law;
pub mod multibody;
pub mod planar;
pub mod problem;
pub mod quantity;
pub mod simulation;
pub mod solver;
pub mod spatial;
pub mod system;
