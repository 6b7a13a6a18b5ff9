//! Wheels with a width: their contacts, how they rest, roll, fall and drive.
#![allow(clippy::unwrap_used)]

pub mod wheel_scenes;

mod descriptions;
mod falling;
mod geometry;
mod motion;
mod precession;
