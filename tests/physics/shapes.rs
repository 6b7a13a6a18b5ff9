//! Several shapes a solid: their masses and inertias, what of them touches, and what a description
//! may not say.
#![allow(clippy::unwrap_used)]

mod descriptions;
mod inertia;
mod resting;
