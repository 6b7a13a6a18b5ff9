//! Sand under wheels: sinkage, slip, traction and ruts.
//!
//! A wheel in sand feels a stress on every piece of it that is under the surface
//! ([`resistive_force`], or [`bekker`] as the baseline of the field), which [`patch`] sums to a
//! force, a moment and their derivatives. [`memory`] is the state of the sand at a wheel, which
//! makes rest and small motions regular. [`test_bed`] is a virtual test bed for one wheel.
//!
//! The chapter sees a wheel, a plane with a relief and six numbers of memory, and no machine: the
//! coupling to a machine is in `rover_core::system`.
//!
//! # One call
//!
//! A wheel in sand; `rover_core::system` makes a force of the machine of it:
//!
//! ```text
//! WheelPose, WheelTwist ──► patch::react     Bed: tangent plane and relief under the wheel
//!                         │
//!                         ▼
//!                      points, pieces        groups of eight; depth and velocity of each
//!                         │   resistive_force::traction, or Bekker::stress
//!                         ▼
//!                      Reaction              force, moment and their derivatives
//!                         │
//!                         ▼
//!                      Memory::after, RutMap the sand as the wheel has left it
//! ```
//!
//! # May use
//!
//! [`friction_contact::quantity`], [`friction_contact::scalar`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod bekker;
pub mod memory;
pub mod patch;
pub mod piece;
mod points;
pub mod resistive_force;
pub mod ruts;
pub mod sliding;
pub mod soil;
pub mod state;
pub mod test_bed;
pub mod wheel;

pub use bekker::Bekker;
pub use memory::{Memory, WheelTwist};
pub use patch::{Bed, Derivatives, Reaction, WheelPose, react, react_with};
pub use resistive_force::{Flow, Interface};
pub use ruts::{RutMap, Window};
pub use soil::{Resistive, Soil, StressLaw};
pub use state::{SandState, WheelInSand};
pub use test_bed::{OperatingPoint, Sunk, TestBed, WheelPerformance};
pub use wheel::{GaussRules, Points, SandWheel};
