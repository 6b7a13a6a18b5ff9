//! The scalar: one rover, or several to a register.
//!
//! - [`lane`]: the scalar and its mask, and `f64` as one lane;
//! - [`instructions`]: what this machine can do, found at run time; `registers`: lanes in its
//!   registers;
//! - [`elementary`]: sine, cosine and exponential with the same bits everywhere;
//! - [`linear`]: vectors and matrices of three dimensions over lanes; `quaternion`: rotations.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod elementary;
pub mod instructions;
pub mod lane;
pub mod linear;
pub(crate) mod quaternion;
mod registers;

pub use instructions::{Instructions, Single};
pub use lane::{Lane, LaneMask, MAX_LANES};
pub use linear::{Mat3, Vec3};
