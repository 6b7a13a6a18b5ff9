//! Grains: free disks in the plane, free balls in space, with friction,
//! walls, a ground, and a machine that drives over them.
//!
//! One code for D = 2 and D = 3; what differs is how many rates of turning a body has and how a
//! frame is made of a normal ([`crate::spatial::space`], [`GrainContact::frame`]).
//!
//! - [`bodies`], [`wall`], [`machine`], [`scene`]: what there is;
//!   [`packing`]: where grains start, without overlap, from a seed;
//! - [`grid`]: which grains are near which; [`contact`]: a contact and its
//!   name; contacts come and go with the grains;
//! - [`system`]: grains as a mechanical system, stepped by [`crate::integrator`] as everything
//!   else: `detection` finds its contacts; `measures`: energy, momentum, overlap;
//! - [`sleep`]: grains that rest far from anything that moves are left out;
//!   [`removal`]: new numbers for those that stay.
//!
//! Grains step with θ = 1: contacts are measured where the step begins and a contact may close as
//! far as its gap goes, `0 ≤ u_N + gap⁺/h ⊥ p_N ≥ 0`. To first order no grain ends a step inside
//! another, and neither gravity (which loses m g²h²/2 a step) nor contact adds energy. What
//! rounding and the solver's tolerance leave of penetration grows by their error in velocity; where
//! it passes a tolerance the common projection removes it.
//!
//! Source: Moreau 1999; Staron and Hinch 2005 (contact dynamics of disks);
//! Anitescu and Potra 1997 (the gap in the velocity's law).

pub mod bodies;
pub mod contact;
mod detection;
pub mod error;
pub mod grid;
pub mod machine;
mod measures;
pub mod packing;
pub mod removal;
pub mod scene;
pub mod sleep;
pub mod system;
pub mod wall;

pub use bodies::{COORDINATES, Grains, MAX_GRAINS};
pub use contact::{GrainContact, GrainKey};
pub use error::GrainError;
pub use machine::{Machine, Wheel};
pub use packing::Packing;
pub use removal::Renumbering;
pub use scene::{GrainFriction, GrainScene, OVERLAP};
pub use sleep::{Sleep, SleepOptions, StepTaken};
pub use system::{GrainParts, GrainSystem};
pub use wall::Wall;
