//! The rover, wheels, balls and boxes on height fields and meshes.
#![allow(clippy::unwrap_used)]

#[path = "rover/scenes.rs"]
#[allow(dead_code)] // the rover's tests use the rest
mod scenes;
#[path = "spheres/sphere_scenes.rs"]
#[allow(dead_code)] // the tests of spheres use the rest
mod sphere_scenes;
#[path = "surfaces/surface_scenes.rs"]
mod surface_scenes;

#[path = "surfaces/completeness.rs"]
mod completeness;
#[path = "surfaces/convergence.rs"]
mod convergence;
#[path = "surfaces/falling.rs"]
mod falling;
#[path = "surfaces/flat.rs"]
mod flat;
#[path = "surfaces/maps.rs"]
mod maps;
#[path = "surfaces/meshes.rs"]
mod meshes;
