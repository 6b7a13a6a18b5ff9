//! The driving task of `Rover-v0`: what a scene is drawn from, what a policy sees and does, what it
//! is rewarded for, and which paths it may choose.
//!
//! Chapters, each using only those above it:
//!
//! - [`draw`]: random numbers, for scenes that are drawn;
//! - [`episode`]: the episodes of a driving task: actions, observations, rewards, ends;
//! - [`paths`]: what a rover would touch on a path over known heights, and the cheapest of many.
#![forbid(unsafe_code)]
// Same bits on every machine: sines and their like come from `rover_core::scalar::elementary`.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod draw;
pub mod episode;
pub mod paths;
