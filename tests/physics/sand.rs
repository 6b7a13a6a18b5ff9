//! Machines whose wheels sink into sand.
#![allow(clippy::unwrap_used)]

#[path = "sand/sand_scenes.rs"]
mod sand_scenes;

#[path = "sand/driving.rs"]
mod driving;
#[path = "sand/forces.rs"]
mod forces;
#[path = "sand/resting.rs"]
mod resting;
