//! Rotations and symmetric inertias: the alphabet of the multibody chapter;
//! [`space`]: what the plane and space share.

pub mod rotation;
pub mod space;
pub mod symmetric;

pub use rotation::{CardanReport, HeadingPitchRoll, exp_rotation};
pub use symmetric::SymmetricMatrix3;
