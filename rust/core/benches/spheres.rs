//! Microseconds a step on spheres.
fn main() {}
