//! Reference methods: another contact law, to measure its error against Coulomb's. No strategy uses
//! them.

pub(super) mod relaxed;
