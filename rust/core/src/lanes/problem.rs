//! One rover's friction-contact problem, handed from a block to the solver and back.
