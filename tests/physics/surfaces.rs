//! The rover, wheels, balls and boxes on height fields and meshes.
#![allow(clippy::unwrap_used)]

pub mod surface_scenes;

mod completeness;
mod convergence;
pub mod falling;
mod first_touch;
mod flat;
mod maps;
mod meshes;
mod seams;
mod supports;
