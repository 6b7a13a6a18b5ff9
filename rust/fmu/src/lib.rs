//! The library of an FMI 3.0 co-simulation unit of a rover.
//!
//! `rover export fmu` packs it with a scene. Arrows point one way: `state` holds modes, parameters
//! and inputs, `scene_file` reads the scene, `unit` steps it, `border` holds the C functions and
//! all unsafe code. The rover itself is `rover-core`'s: the unit has no mechanics.
#![deny(unsafe_code)]

mod border;
mod inertial;
mod reading;
mod refusal;
mod saved;
mod scene_file;
mod state;
mod unit;
