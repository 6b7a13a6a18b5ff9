//! The ordinary step of a block.
