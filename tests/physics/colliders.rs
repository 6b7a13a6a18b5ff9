//! Cylinders, capsules, ellipsoids and convex hulls: at rest, rolling, in heaps, and in the place
//! of a rover's boxes.
#![allow(clippy::unwrap_used)]

mod collider_scenes;
mod heaps;
mod of_a_rover;
mod resting;
mod rolling;
