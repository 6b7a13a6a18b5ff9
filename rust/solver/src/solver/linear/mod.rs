//! The linear systems of the iterations and their factors: dense for few contacts, block-sparse for
//! many.

mod block_lu;
mod dense;
pub(super) mod lemke;
pub(super) mod reduced_system;
