//! Whole behaviour of the core: laws, closed forms, recorded references and invariants.
//!
//! One program, so that the core is linked once.

mod among_grains;
mod contacts;
mod exploring_scenes;
mod grains;
mod joints;
mod lanes;
mod laws;
mod materials;
mod planar;
mod rolling;
mod rover;
mod sand;
mod shapes;
mod solver;
mod solver_methods;
mod solver_npz;
mod solver_row;
mod solver_scenes;
mod solver_shelf;
mod spheres;
mod surfaces;
mod vessels;
mod wheels;
