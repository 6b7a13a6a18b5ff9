//! The planar systems: against references, closed forms and conservation laws.
#![allow(clippy::unwrap_used)]

#[path = "planar/scenes.rs"]
mod scenes;

#[path = "planar/ball.rs"]
mod ball;
#[path = "planar/composite.rs"]
mod composite;
#[path = "planar/mirrored_rover.rs"]
mod mirrored_rover;
#[path = "planar/siconos.rs"]
mod siconos;
#[path = "planar/soil.rs"]
mod soil;
#[path = "planar/two_wheel_rover.rs"]
mod two_wheel_rover;
