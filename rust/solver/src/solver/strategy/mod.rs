//! The strategies: the order in which stages are tried. The [table](crate::solver) lists their
//! rungs.
//!
//! - `auto`: a problem `(W, q, μ)` of any size, with `islands` for many contacts in separate
//!   groups;
//! - `many_bodies`: very many free bodies, whose contacts stand in for `W`.

pub(super) mod auto;
pub(super) mod islands;
pub(super) mod many_bodies;
