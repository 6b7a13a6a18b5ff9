//! Machines whose wheels sink into sand.
#![allow(clippy::unwrap_used)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // numbers of steps

pub(crate) mod sand_scenes;

mod derivatives;
mod driving;
mod forces;
mod published_law;
mod resting;
