//! The rover, and single wheels, on fields of spheres.
#![allow(clippy::unwrap_used)]

#[path = "rover/scenes.rs"]
#[allow(dead_code)] // the rover's tests use the rest
mod scenes;
#[path = "spheres/sphere_scenes.rs"]
mod sphere_scenes;

#[path = "spheres/climbing.rs"]
mod climbing;
#[path = "spheres/derivatives.rs"]
mod derivatives;
#[path = "spheres/driving.rs"]
mod driving;
#[path = "spheres/drops.rs"]
mod drops;
#[path = "spheres/resting.rs"]
mod resting;
#[path = "spheres/symmetry.rs"]
mod symmetry;
#[path = "spheres/tunnelling.rs"]
mod tunnelling;
