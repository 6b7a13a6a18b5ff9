//! Configurations of the rovers of a block.
