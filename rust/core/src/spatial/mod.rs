//! Rotations and symmetric inertias, on which the multibody chapter is built, and formulas that the
//! plane and space share ([`space`]).
//!
//! # One call
//!
//! ```text
//! v ω h ──► exp_rotation ──► unit quaternion ──► HeadingPitchRoll or CardanReport for users
//! ```
//!
//! # May use
//!
//! [`crate::scalar`].

pub mod rotation;
pub mod space;
pub mod symmetric;

pub use rotation::{
    CardanReport, HeadingPitchRoll, exp_rotation, quaternion_about, rotation_about,
};
pub use symmetric::SymmetricMatrix3;
