//! Nonsmooth multibody mechanics of a wheeled rover.
#![forbid(unsafe_code)]

pub mod cone;
pub mod law;
pub mod problem;
pub mod solver;
