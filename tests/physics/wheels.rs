//! Wheels with a width: their contacts, how they rest, roll, fall and drive.
#![allow(clippy::unwrap_used)]

#[path = "rover/scenes.rs"]
#[allow(dead_code)] // the rover's tests use the rest
mod scenes;
#[path = "spheres/sphere_scenes.rs"]
#[allow(dead_code)] // the tests of spheres use the rest
mod sphere_scenes;
#[path = "surfaces/surface_scenes.rs"]
#[allow(dead_code)] // the tests of surfaces use the rest
mod surface_scenes;
#[path = "wheels/wheel_scenes.rs"]
mod wheel_scenes;

#[path = "wheels/descriptions.rs"]
mod descriptions;
#[path = "wheels/falling.rs"]
mod falling;
#[path = "wheels/geometry.rs"]
mod geometry;
#[path = "wheels/motion.rs"]
mod motion;
