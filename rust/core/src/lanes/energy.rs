//! Kinetic and potential energy of a block.
