//! Derivatives of a tree's step while its contact modes hold.
//!
//! The sources of the step run once more over dual numbers ([`crate::scalar::Dual`]), a direction a
//! lane: poses, mass matrix, bias, drives, contact rows, energy. The linear systems are not
//! differentiated but their residuals, at the solution of the step:
//!
//! ```text
//! M̂ w = r + H p         dw = M̂⁻¹ (dr + dH p − dM̂ w)             with one factor of M̂ for all
//! u = Hᵀ v⁺             du⁰ = dHᵀ v⁺ + Hᵀ (dv + dw)              at held impulses
//! the modes' equations  dp = S du⁰ + s dμ                        integrator::contact_modes
//! v⁺ = v + w            dv⁺ = dv + dw + M̂⁻¹ H dp
//! ```
//!
//! The projection of the position is differentiated in the same way, then the position and what
//! the energy audit left of the velocity.
//!
//! Source: Lidec et al. 2024, *End-to-end and highly-efficient differentiable simulation for
//! robotics* (Simple), arXiv 2409.07107, for the residuals by the recursive Newton–Euler algorithm.
//!
//! Closed loops are differentiated by the sources that close them, with a factor of M̂ for each
//! direction: the start as `set_state` closes it, the mean velocity, and the end.
//!
//! The force of sand on a wheel depends on the velocity at the end of the step. With dF at a held
//! velocity `v⁺` the sources above give dv⁺, and the change that follows from it is added:
//!
//! ```text
//! F = f(J v⁺, m)        dF = df + z,   z = D J (dv⁺ + R z)       held_sand
//! ```
//!
//! - `direction`: what varies; `held_tree`, `held_sand`: what a step held; `contacts`: their places
//!   and velocities; `closed_loops`; `varying_sand`, `sand`: wheels in sand; `scratch`, `pass`:
//!   one pass, a direction a lane.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod closed_loops;
mod contacts;
mod direction;
mod held_sand;
mod held_tree;
mod pass;
mod sand;
mod scratch;
mod varying_sand;

pub(crate) use direction::Direction;
pub(crate) use held_sand::{HeldSand, OF_WHEEL, SandError};
pub(crate) use held_tree::{HeldTree, TangentScene};
pub(crate) use scratch::Tangent;
