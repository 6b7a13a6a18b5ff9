//! The sources that run over one rover or several to a register, against those for any machine.
#![allow(clippy::unwrap_used)]

#[path = "lanes/contacts.rs"]
mod contacts;
#[path = "lanes/tree.rs"]
mod tree;

#[path = "lanes/fleet.rs"]
mod fleet;
