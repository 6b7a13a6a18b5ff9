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
//! [`friction_contact::scalar`], [`friction_contact::space`].

pub mod polytope;
pub mod quaternion;
pub mod rotation;
pub mod symmetric;

pub use friction_contact::space;
pub use polytope::{MAX_VERTICES, Polytope, PolytopeEdge, PolytopeFace};
pub use rotation::{
    CardanReport, HeadingPitchRoll, exp_rotation, quaternion_about, rotation_about,
};
pub use symmetric::SymmetricMatrix3;
