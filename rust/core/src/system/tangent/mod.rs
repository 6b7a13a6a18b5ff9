//! Derivatives of a tree's step while its contact modes hold.
//!
//! The scheme ([`crate::integrator::scheme`]) takes the step once more over dual numbers
//! ([`crate::scalar::Dual`]), a direction a lane. Its contacts are those that the step had, and the
//! answer of its problem is that of the step, with the derivative of the modes' equations:
//!
//! ```text
//! M̂ w = r + H p         w by the scheme, with a factor of M̂ for each direction
//! u = Hᵀ v⁺             du⁰ = dHᵀ v⁺ + Hᵀ (dv + dw)              at held impulses
//! the modes' equations  dp = S du⁰ + s dμ                        integrator::contact_modes
//! ```
//!
//! So is the projection of the position. What the audit makes of the velocity, implicit gyroscopic
//! terms and closed loops are the scheme's own; the start is closed as `set_state` closes it. A
//! step that the usual effort would not have taken has no derivative.
//!
//! The force of sand on a wheel depends on the velocity at the end of the step. With dF at a held
//! velocity `v⁺` the sources above give dv⁺, and the change that follows from it is added:
//!
//! ```text
//! F = f(J v⁺, m)        dF = df + z,   z = D J (dv⁺ + R z)       held_sand
//! ```
//!
//! - `direction`: what varies; `held_tree`, `held_sand`: what a step held; `held_system`: it as the
//!   systems of the scheme; `held_places`, `contacts`: their places and velocities;
//!   `varying_sand`, `sand`: wheels in sand; `scratch`, `pass`: one pass, a direction a
//!   lane.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod contacts;
mod direction;
mod held_places;
mod held_sand;
mod held_system;
mod held_tree;
mod pass;
mod sand;
mod scratch;
mod varying_sand;

pub(crate) use direction::Direction;
pub(crate) use held_sand::{HeldSand, OF_WHEEL, SandError};
pub(crate) use held_tree::{HeldTree, TangentScene};
pub(crate) use scratch::TangentPass;

use crate::scalar::Lane;

/// `sum + row · x`.
#[inline(always)]
fn along<T: Lane>(row: &[f64], x: &[T], mut sum: T) -> T {
    for (a, x) in row.iter().zip(x) {
        sum += x.like(*a) * *x;
    }
    sum
}
