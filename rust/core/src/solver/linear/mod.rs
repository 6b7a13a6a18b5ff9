//! The linear systems of the iterations, and their factors: dense for few
//! contacts, sparse blocks for many.

mod block_lu;
mod dense;
pub(super) mod reduced_system;
