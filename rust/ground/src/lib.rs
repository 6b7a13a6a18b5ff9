//! Shapes, the ground, and sand. Nothing here knows a machine.
//!
//! Chapters, each using only those above it:
//!
//! - [`spatial`]: rotations and inertias;
//! - [`sand`]: the force of sand on a wheel;
//! - [`geometry`]: shapes, the ground, distances between them, rays.
#![forbid(unsafe_code)]
// Same bits on every machine: sines and their like are those of `friction_contact::scalar`.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod geometry;
pub mod sand;
pub mod spatial;
