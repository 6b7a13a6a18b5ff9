//! Answers to compare with: another law, and what it costs to take it for
//! Coulomb's. No strategy uses them.

pub(super) mod relaxed;
