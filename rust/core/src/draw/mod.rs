//! Random numbers and what is drawn from them.
//!
//! - [`pcg64`]: the generator of NumPy's `default_rng`, number for number;
//! - [`seed_sequence`]: its state for a seed;
//! - [`normal`]: standard normal numbers.

pub mod normal;
mod normal_layers;
pub mod pcg64;
pub mod seed_sequence;

pub use pcg64::{Pcg64, Pcg64State};
