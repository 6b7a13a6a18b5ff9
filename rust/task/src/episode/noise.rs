//! Noise of the sensors.
//!
//! Every entry of an observation that is measured gets `σ z`, with its own standard deviation σ and
//! its own standard normal number z, drawn anew each period. Flags, fractions, unit vectors,
//! distances and actions stay exact: their σ is zero, but their numbers are drawn too.

use crate::draw::Pcg64;

/// Fills `normals` with standard normal numbers, in order.
pub fn draw(generator: &mut Pcg64, normals: &mut [f64]) {
    for z in normals {
        *z = generator.normal();
    }
}
