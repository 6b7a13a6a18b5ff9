//! Whole behaviour of the rover: against references, closed forms and conservation laws.
#![allow(clippy::unwrap_used)]

pub mod scenes;

mod batch;
mod derivatives;
mod driving;
mod exploring;
mod free_flight;
mod inclined_plane;
mod orders;
mod parked;
mod round_trips;
mod stability;
mod starts;
mod symmetry;
mod trees;
mod welding;
mod work;
