//! The planar systems: against references, closed forms and conservation laws.
#![allow(clippy::unwrap_used)]

mod scenes;

mod ball;
mod mirrored_rover;
mod siconos;
mod soil;
mod two_wheel_rover;
