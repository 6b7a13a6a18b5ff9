//! Mass matrix of a block and its factor.
