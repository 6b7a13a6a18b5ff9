//! Rotations and symmetric inertias, on which the multibody chapter is built, and formulas that the
//! plane and space share ([`space`]).

pub mod rotation;
pub mod space;
pub mod symmetric;

pub use rotation::{
    CardanReport, HeadingPitchRoll, exp_rotation, quaternion_about, rotation_about,
};
pub use symmetric::SymmetricMatrix3;
