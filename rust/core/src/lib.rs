//! Nonsmooth multibody mechanics of a wheeled rover.
#![forbid(unsafe_code)]

pub use nalgebra;

pub mod cone;
pub mod contact;
pub mod geometry;
pub mod integrator;
pub mod law;
pub mod multibody;
pub mod problem;
pub mod simulation;
pub mod solver;
pub mod spatial;
