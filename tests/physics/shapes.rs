//! Several shapes a solid: their masses and inertias, what of them touches, and what a description
//! may not say.
#![allow(clippy::unwrap_used)]

#[path = "shapes/descriptions.rs"]
mod descriptions;
#[path = "shapes/inertia.rs"]
mod inertia;
#[path = "shapes/machines.rs"]
mod machines;
#[path = "shapes/resting.rs"]
mod resting;
