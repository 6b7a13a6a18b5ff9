//! Rotations and symmetric inertias, on which the multibody chapter is built, and formulas that the
//! plane and space share ([`space`]). [`polytope`] is the convex hull of a few points.
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

pub mod polytope;
pub mod rotation;
pub mod space;
pub mod symmetric;

pub use polytope::{MAX_VERTICES, Polytope, PolytopeEdge, PolytopeFace};
pub use rotation::{
    CardanReport, HeadingPitchRoll, exp_rotation, quaternion_about, rotation_about,
};
pub use symmetric::SymmetricMatrix3;
