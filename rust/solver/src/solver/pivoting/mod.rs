//! Pivoting on the contact modes: from a warm start, one contact at a time changes its mode.
//!
//! The source is generic over the scalar ([`Lane`](crate::scalar::Lane)), the storage
//! (`store`) and the [linear systems](System). [`super::batch`] runs it with fixed arrays on one, four or eight
//! problems side by side; the stage `pivoting` runs it on one problem with any number of contacts.
//!
//! Full Newton steps change all modes at once and cycle if W is rank deficient: six wheels in a
//! turn work against each other with forces in the null space of W, and a slip of 1e-6 m/s decides
//! which of them slide. Here a step goes from the warm start to the answer of the present modes
//! only as far as all cones allow. The contact that blocks then slides or opens, and the next
//! system is solved. This is the ratio test of a primal active-set method. It may fail for the
//! nonassociated law; then the caller continues.
//!
//! - `iteration`: the steps; `mode_changes`: how contacts change their modes after a full one;
//! - `violation`: how much the impulses violate the law; `limit`: their way to the limit of
//!   friction;
//! - `mode_memory`: which modes a solve has tried;
//! - `system`: what pivoting needs of its problems; `store`: where it keeps the contacts' numbers.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod iteration;
mod limit;
mod mode_changes;
mod mode_memory;
mod store;
mod system;
mod violation;

pub(crate) use iteration::Pivoting;
#[cfg(test)]
pub(crate) use iteration::tests::rests;
pub(crate) use mode_changes::NO_GAIN;
pub use store::Triple;
pub(crate) use store::{Few, Many};
pub(crate) use system::System;

/// Initial `α` of further attempts from the same start. With a large one each system is a short
/// step of the proximal point method: modes that decide themselves by a slip of 1e-6 m/s change one
/// after the other, where full steps go round in circles. Of 3398 steps of exploring drives that
/// pivoting with the first `α` does not solve, 0.1 solves 2995, 1 then 230 and 0.01 then 62.
pub(crate) const FURTHER_ALPHAS: [f64; 3] = [0.1, 1.0, 0.01];
