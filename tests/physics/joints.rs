//! The catalogue of joints: every kind against a formula or an independent computation.
#![allow(clippy::unwrap_used)]

#[path = "joints/closed_forms.rs"]
mod closed_forms;
#[path = "joints/coupling.rs"]
mod coupling;
#[path = "joints/derivatives.rs"]
mod derivatives;
#[path = "joints/descriptions.rs"]
mod descriptions;
#[path = "joints/drives.rs"]
mod drives;
#[path = "joints/limits.rs"]
mod limits;
#[path = "joints/machines.rs"]
mod machines;
#[path = "joints/several_trees.rs"]
mod several_trees;
