//! Which stage when: the strategies, whose rungs the [table](crate::solver) lists.
//!
//! - `auto`: a problem `(W, q, μ)` of any size, with `islands` for many
//!   contacts that fall apart into groups;
//! - `many_bodies`: very many free bodies, whose contacts stand in for `W`.

pub(super) mod auto;
pub(super) mod islands;
pub(super) mod many_bodies;
