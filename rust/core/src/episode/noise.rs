//! Noise of the sensors.
//!
//! Every entry of an observation that is measured gets `standard deviation · z` with a standard
//! normal number z of its own. Flags, fractions, unit vectors, distances and actions stay exact:
//! their standard deviation is zero, but their numbers are drawn too.

/// Standard deviation of each entry's noise, in units of the observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// (size of the observation).
    pub deviations: Vec<f64>,
}
