//! The scalar: one rover, or several to a register.
//!
//! - [`lane`]: the scalar and its mask, and `f64` as one lane;
//! - [`instructions`]: what this machine can do, found at run time; `registers`: lanes in its
//!   registers;
//! - [`elementary`]: sine, cosine and exponential with the same bits everywhere;
//! - [`dual`]: lanes with derivatives;
//! - [`linear`]: vectors and matrices of three dimensions over lanes.
//!
//! # One call
//!
//! ```text
//! Instructions::of_this_machine() ──► token of Single, Fours or Eights
//! T::vectorize(token, || formula(x, y))    the closure is compiled for the token's instructions
//!                        │
//!                        └─ x: T           f64, four or eight lanes; each has the same bits
//!                           x.lt(y)        a mask; T::select(mask, a, b) in place of a branch
//! ```
//!
//! # May use
//!
//! No other chapter.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod dual;
pub mod elementary;
pub mod instructions;
pub mod lane;
pub mod linear;
mod registers;

pub use dual::Dual;
#[cfg(target_arch = "x86_64")]
pub use instructions::{Eights, Fours};
pub use instructions::{Instructions, InstructionsError, Single};
pub use lane::{Lane, LaneMask, MAX_LANES};
pub use linear::{Mat3, Vec3};
