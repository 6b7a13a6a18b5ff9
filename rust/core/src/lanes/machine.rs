//! The machine that all rovers of a block share: its tree, its wheels, and the inertias of each.
