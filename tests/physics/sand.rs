//! Machines whose wheels sink into sand.
#![allow(clippy::unwrap_used)]

mod sand_scenes;

mod driving;
mod forces;
mod resting;
