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
//! inlined!(T::vectorize, token, formula(x, y))    compiled for the token's instructions
//!                        │
//!                        └─ x: T           f64, four or eight lanes; each has the same bits
//!                           x.lt(y)        a mask; T::select(mask, a, b) in place of a branch
//! ```
//!
//! # May use
//!
//! No other chapter.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

/// Calls a function, as [`Lane::vectorize`](crate::scalar::Lane::vectorize), with a token and a
/// closure of the last argument that is inlined into it.
#[macro_export]
macro_rules! inlined {
    ($run:path, $token:expr, $body:expr) => {
        $run(
            $token,
            #[inline(always)]
            || $body,
        )
    };
}

pub mod dual;
pub mod elementary;
pub mod instructions;
pub mod lane;
pub mod linear;
mod registers;

pub use crate::inlined;
pub use dual::Dual;
#[cfg(target_arch = "x86_64")]
pub use instructions::{Eights, Fours};
pub use instructions::{Instructions, InstructionsError, Single};
pub use lane::{Lane, LaneMask, MAX_LANES};
pub use linear::{Mat3, Vec3};
