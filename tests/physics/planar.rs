//! The planar systems: against references, closed forms and conservation laws.
#![allow(clippy::unwrap_used)]

mod scenes;

mod ball;
mod disks;
mod mirrored_rover;
mod siconos;
mod two_wheel_rover;
