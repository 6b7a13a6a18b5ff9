//! The rover, and single wheels, on fields of spheres.
#![allow(clippy::unwrap_used)]

pub mod sphere_scenes;

mod climbing;
mod derivatives;
mod driving;
mod drops;
mod resting;
mod symmetry;
mod tunnelling;
