//! Forces of sand.
