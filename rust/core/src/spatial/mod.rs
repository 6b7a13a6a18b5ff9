//! Rotations and symmetric inertias: the alphabet of the multibody chapter.

pub mod rotation;
pub mod symmetric;

pub use rotation::{CardanReport, HeadingPitchRoll, exp_rotation};
pub use symmetric::SymmetricMatrix3;
