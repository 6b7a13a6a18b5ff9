//! The time-stepping schemes of the comparison.

mod free_spheres;
mod integrators;
