//! The ground under each rover of a block.
