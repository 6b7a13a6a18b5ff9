//! Whole behaviour of laws and solvers of contact: known answers, recorded problems, invariants.

mod known_answers;
mod laws;
mod methods;
mod npz;
mod row;
mod scenes;
mod shelf;
mod solving;
