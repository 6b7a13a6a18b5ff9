//! Whole behaviour of the rover: against references, closed forms and conservation laws.
#![allow(clippy::unwrap_used)]

#[path = "exploring_scenes.rs"]
mod exploring_scenes;
#[path = "rover/scenes.rs"]
mod scenes;

#[path = "rover/batch.rs"]
mod batch;
#[path = "rover/driving.rs"]
mod driving;
#[path = "rover/episodes.rs"]
mod episodes;
#[path = "rover/exploring.rs"]
mod exploring;
#[path = "rover/free_flight.rs"]
mod free_flight;
#[path = "rover/inclined_plane.rs"]
mod inclined_plane;
#[path = "rover/orders.rs"]
mod orders;
#[path = "rover/parked.rs"]
mod parked;
#[path = "rover/reference_model.rs"]
mod reference_model;
#[path = "rover/round_trips.rs"]
mod round_trips;
#[path = "rover/stability.rs"]
mod stability;
#[path = "rover/symmetry.rs"]
mod symmetry;
#[path = "rover/trees.rs"]
mod trees;
#[path = "rover/welding.rs"]
mod welding;
#[path = "rover/work.rs"]
mod work;
