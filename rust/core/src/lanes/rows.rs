//! Contact Jacobian, Delassus operator and impulses of a block.
