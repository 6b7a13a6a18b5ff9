//! Grains: free disks in the plane, free balls in space, with friction,
//! walls, a ground, and a planar machine that drives over them.
//!
//! One code serves D = 2 and D = 3. Only the number of angular rates of a body and the construction
//! of a frame from a normal differ ([`crate::spatial::space`], [`GrainContact::frame`]).
//!
//! - [`bodies`], [`wall`], [`scene`]: the description; [`packing`]: initial positions without
//!   overlap, from a seed;
//! - [`crate::law::cohesion`]: an attraction of contacts;
//! - [`grid`]: the search for neighbours; [`contact`]: a contact and its key; `struck` and
//!   `struck_pairs`: pairs that an impact of the same step brings together;
//! - [`system`]: grains as a mechanical system for [`crate::integrator`]; `search` and `detection`:
//!   its contacts; `measures`: energy, momentum, overlap;
//! - [`sleep`]: leaves out grains that rest far from anything that moves; [`removal`]: takes grains
//!   out and renumbers the others.
//!
//! Grains step with θ = 1: contacts are measured at the start of the step and may close by their
//! gap, `0 ≤ u_N + gap⁺/h ⊥ p_N ≥ 0`. To first order no grain ends a step inside another, and
//! neither gravity (which loses m g²h²/2 per step) nor contact adds energy. Penetration grows with
//! the velocity errors of rounding and of the solver's tolerance; position projection removes it
//! once it exceeds a tolerance.
//!
//! Source: Moreau 1999; Staron and Hinch 2005 (contact dynamics of disks);
//! Anitescu and Potra 1997 (the gap in the velocity's law).

pub mod bodies;
pub mod contact;
mod detection;
pub mod error;
pub mod grid;
mod measures;
pub mod packing;
pub mod removal;
mod rolling;
pub mod scene;
pub(in crate::system) mod search;
mod slabs;
pub mod sleep;
mod struck;
mod struck_pairs;
pub mod system;
pub mod wall;

pub use crate::law::cohesion::Cohesion;
pub use bodies::{COORDINATES, Grains, MAX_GRAINS};
pub use contact::{GrainContact, GrainKey};
pub use error::GrainError;
pub use grid::Grid;
pub use packing::{Packing, arranged};
pub use removal::Renumbering;
pub use rolling::{Moments, moment_of};
pub use scene::{GrainFriction, GrainScene, OVERLAP};
pub use sleep::{Mover, Sleep, SleepOptions, StepTaken};
pub use system::{GrainParts, GrainSystem};
pub use wall::Wall;
