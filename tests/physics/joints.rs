//! The catalogue of joints: every kind against a formula or an independent computation.
#![allow(clippy::unwrap_used)]

mod bar_differential;
mod closed_forms;
mod coupling;
mod derivatives;
mod descriptions;
mod drives;
mod friction;
mod limits;
mod loops;
mod machines;
mod servo;
mod several_trees;
mod stand;
mod wrenches;
