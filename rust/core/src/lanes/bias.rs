//! Bias forces of a block.
