//! Whole behaviour of the core: laws, closed forms, recorded references and invariants.
//!
//! One program, so that the core is linked once.

mod among_grains;
mod colliders;
mod contacts;
mod exploring_scenes;
mod grain_scenes;
mod grains;
mod joints;
mod lanes;
mod materials;
mod planar;
mod rolling;
mod rover;
mod rover_kinds;
mod sand;
mod shapes;
mod shared;
mod spheres;
mod surfaces;
mod vessels;
mod wheels;
