//! The stages: iterations that take an impulse and leave a better one.

pub(super) mod body_sweeps;
